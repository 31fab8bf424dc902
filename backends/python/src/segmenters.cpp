// SPDX-License-Identifier: BSD-2-Clause
#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <shared_mutex>
#include <thread>
#include <utility>
#include <vector>

#include "bindings.hpp"
#include "calls.hpp"
#include "frames.hpp"
#include "segmenter.hpp"
#include "sequences.hpp"
#include "stillpoint/backends/mask_files.hpp"
#include "stillpoint/segmentation/detection_thread.hpp"
#ifdef STILLPOINT_WITH_OPENCV_DNN
#include "stillpoint/backends/opencv_dnn/segmenter.hpp"
#endif

namespace stillpoint::python {
namespace {

/// A segmenter that two threads may share: a network is used by one frame at a time, the others
/// wait for their turn.
template <class Inner>
class Shared : public Inner {
 public:
  using Inner::Inner;
  Segmentation segment(const RgbdFrame& frame) override {
    const std::lock_guard<std::mutex> turn(mutex_);
    return Inner::segment(frame);
  }

 private:
  std::mutex mutex_;
};

/// A DetectionThread that one Python thread may close while others use it, and that ends without
/// the GIL, which its segmenter may wait for. Python may destroy it in its own thread, where it
/// collects garbage: another thread ends it then.
class PyDetectionThread : public Segmenter {
 private:
  using ThreadId = std::shared_ptr<std::atomic<std::thread::id>>;
  /// The segmenter, which tells the thread that it runs in.
  struct Watched : Segmenter {
    Watched(const py::object& segmenter, ThreadId id)
        : object(segmenter), own(*segmenter.cast<Segmenter*>()), runs_in(std::move(id)) {}
    Segmentation segment(const RgbdFrame& frame) override {
      *runs_in = std::this_thread::get_id();
      return own.segment(frame);
    }
    std::vector<std::string> classes() const override { return own.classes(); }

    py::object object;  // kept alive
    Segmenter& own;
    const ThreadId runs_in;
  };
  struct Running {
    Running(const py::object& segmenter, const ThreadId& id)
        : watched(segmenter, id), thread(watched) {}
    Watched watched;
    DetectionThread thread;
  };

  /// Gives the GIL back while it lives, if this thread has it.
  struct WithoutGil {
    WithoutGil() {
      if (PyGILState_Check()) release.emplace();
    }
    std::optional<py::gil_scoped_release> release;
  };

  template <class Call>
  auto use(Call&& call) const {
    const WithoutGil without_gil;
    const std::shared_lock<std::shared_mutex> in_use(mutex_);
    if (!running_) throw Error("DetectionThread: expected an open one, found it closed");
    return call(running_->thread);
  }

 public:
  explicit PyDetectionThread(const py::object& segmenter)
      : running_(std::make_unique<Running>(segmenter, runs_in_)) {
    all().insert(this);
  }
  ~PyDetectionThread() override {
    all().erase(this);
    if (is_own_thread())
      enders().emplace_back([running = std::move(running_)]() mutable { end(running); });
    else
      close();
  }
  Segmentation segment(const RgbdFrame& frame) override {
    return use([&](DetectionThread& thread) { return thread.segment(frame); });
  }
  std::vector<std::string> classes() const override {
    return use([](const DetectionThread& thread) { return thread.classes(); });
  }
  std::size_t dropped() const {
    return use([](const DetectionThread& thread) { return thread.dropped(); });
  }
  bool wait_for_result(double timeout_s) {
    return use([&](DetectionThread& thread) { return thread.wait_for_result(timeout_s); });
  }
  void close() {
    if (is_own_thread())
      throw Error("DetectionThread.close: expected another thread than its own, found segment()");
    const WithoutGil without_gil;
    const std::lock_guard<std::shared_mutex> alone(mutex_);
    if (running_) end(running_);
  }
  /// Before the interpreter ends: its threads must not come back to it.
  static void close_all() {
    for (PyDetectionThread* thread : all()) thread->close();
    const WithoutGil without_gil;
    for (std::thread& ender : enders()) ender.join();
    enders().clear();
  }

 private:
  bool is_own_thread() const { return runs_in_->load() == std::this_thread::get_id(); }

  /// Waits for the frame at work, without the GIL; the segmenter itself goes with it.
  static void end(std::unique_ptr<Running>& running) {
    py::object segmenter = std::move(running->watched.object);
    const ThreadId runs_in = running->watched.runs_in;
    running.reset();
    *runs_in = std::thread::id();  // another thread may have the same one later
    const py::gil_scoped_acquire gil;
    segmenter = py::object();
  }

  static std::set<PyDetectionThread*>& all() {
    static std::set<PyDetectionThread*> threads;
    return threads;
  }
  static std::vector<std::thread>& enders() {
    static std::vector<std::thread> threads;
    return threads;
  }

  const ThreadId runs_in_ = std::make_shared<std::atomic<std::thread::id>>();
  mutable std::shared_mutex mutex_;
  std::unique_ptr<Running> running_;
};

/// Waits in short steps, so that Ctrl-C is heard.
bool wait_for_result(PyDetectionThread& thread, const py::object& timeout_s) {
  using Clock = std::chrono::steady_clock;
  const double seconds = number_of(timeout_s, "timeout_s");
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (true) {
    const double left = std::chrono::duration<double>(end - Clock::now()).count();
    const double step = std::max(0.0, std::min(0.05, left));
    if (without_gil([&] { return thread.wait_for_result(step); })) return true;
    if (left <= 0) return false;
  }
}

void bind_detection_thread(py::module_& m) {
  py::class_<PyDetectionThread, Segmenter>(
      m, "DetectionThread",
      "Runs a segmenter beside the camera, at its own pace: its segment() never waits, and the\n"
      "front end predicts its late results forward.")
      .def(py::init([](const py::object& segmenter) {
             if (!segmenter_of(segmenter, "DetectionThread: segmenter"))
               throw Error(
                   "DetectionThread: segmenter: expected a stillpoint.Segmenter, found "
                   "None");
             return std::make_unique<PyDetectionThread>(segmenter);
           }),
           py::arg("segmenter"))
      .def("wait_for_result", &wait_for_result, py::arg("timeout_s"),
           "Waits until there is a result to fetch, at most timeout_s seconds; False if not.")
      .def("close", &PyDetectionThread::close, "Ends the thread; waits for the frame at work.")
      .def_property_readonly("dropped", &PyDetectionThread::dropped,
                             "How many frames were replaced by newer ones.");
  py::module_::import("atexit").attr("register")(
      py::cpp_function([] { PyDetectionThread::close_all(); }));
}

void bind_mask_files(py::module_& m) {
  py::class_<Shared<MaskFilesSegmenter>, Segmenter>(
      m, "MaskFilesSegmenter",
      "A folder of masks as a Segmenter: STEM.png, 8 bits, 0 = background, k = instance k, or\n"
      "only 0 and 255. A missing file: no result for its frame.")
      .def(py::init([](const py::object& folder, const py::object& sequence,
                       const py::object& class_name, const py::object& min_area_px,
                       const py::object& max_difference_s) {
             MaskFilesSegmenter::Settings settings;
             settings.class_name = text_of(class_name, "class_name");
             settings.min_area_px = int_of(min_area_px, "min_area_px");
             settings.max_difference_s = number_of(max_difference_s, "max_difference_s");
             const auto path = path_of(folder, "MaskFilesSegmenter: folder");
             if (sequence.is_none())
               return std::make_unique<Shared<MaskFilesSegmenter>>(path, settings);
             return std::make_unique<Shared<MaskFilesSegmenter>>(
                 path, frame_names(sequence_of(sequence, "MaskFilesSegmenter: sequence")),
                 settings);
           }),
           py::arg("folder"), py::arg("sequence") = py::none(), py::kw_only(),
           py::arg("class_name") = "person", py::arg("min_area_px") = 50,
           py::arg("max_difference_s") = 0.005,
           "sequence: TumSequence whose color files name the masks; None: masks are named by\n"
           "timestamps.")
      .def_property_readonly("masks", &Shared<MaskFilesSegmenter>::masks,
                             "Number of frames that have a mask.");
}

#ifdef STILLPOINT_WITH_OPENCV_DNN
std::unique_ptr<Shared<OpenCvDnnSegmenter>> make_network(
    const py::object& model, const py::object& config, const py::object& decoder,
    const py::object& class_names, const py::object& input_size, const py::dict& decoding) {
  OpenCvDnnSettings s;
  if (!config.is_none()) s.config = path_of(config, "config");
  if (!decoder.is_none()) s.decoder = text_of(decoder, "decoder");
  if (!class_names.is_none())
    for (const py::handle& name : class_names)
      s.class_names.push_back(text_of(name, "class_names"));
  if (!input_size.is_none()) {
    const std::vector<double> size = numbers_of(input_size, "input_size");
    if (size.size() != 2)
      throw Error("input_size: expected (width, height), found " + std::to_string(size.size()) +
                  " numbers");
    s.input_size = {static_cast<int>(size[0]), static_cast<int>(size[1])};
  }
  s.decoding.min_score = static_cast<float>(number_of(decoding["min_score"], "min_score"));
  s.decoding.mask_threshold =
      static_cast<float>(number_of(decoding["mask_threshold"], "mask_threshold"));
  s.decoding.max_overlap = static_cast<float>(number_of(decoding["max_overlap"], "max_overlap"));
  s.decoding.max_instances = int_of(decoding["max_instances"], "max_instances");
  s.backend = int_of(decoding["backend"], "backend");
  s.target = int_of(decoding["target"], "target");
  const auto file = path_of(model, "model");
  return without_gil([&] { return std::make_unique<Shared<OpenCvDnnSegmenter>>(file, s); });
}

void bind_opencv_dnn(py::module_& m) {
  py::class_<Shared<OpenCvDnnSegmenter>, Segmenter>(
      m, "OpenCvDnnSegmenter",
      "A network that OpenCV's DNN module runs, e.g. an .onnx file. Its decoder is recognised\n"
      "from its outputs.")
      .def(
          py::init([](const py::object& model, const py::object& config, const py::object& decoder,
                      const py::object& class_names, const py::object& input_size,
                      const py::object& min_score, const py::object& mask_threshold,
                      const py::object& max_overlap, const py::object& max_instances,
                      const py::object& backend, const py::object& target) {
            py::dict decoding;
            decoding["min_score"] = min_score, decoding["mask_threshold"] = mask_threshold;
            decoding["max_overlap"] = max_overlap, decoding["max_instances"] = max_instances;
            decoding["backend"] = backend, decoding["target"] = target;
            return make_network(model, config, decoder, class_names, input_size, decoding);
          }),
          py::arg("model"), py::kw_only(), py::arg("config") = py::none(),
          py::arg("decoder") = py::none(), py::arg("class_names") = py::none(),
          py::arg("input_size") = py::none(), py::arg("min_score") = 0.0,
          py::arg("mask_threshold") = 0.0, py::arg("max_overlap") = 0.5,
          py::arg("max_instances") = 100,
          py::arg("backend") = static_cast<int>(cv::dnn::DNN_BACKEND_OPENCV),
          py::arg("target") = static_cast<int>(cv::dnn::DNN_TARGET_CPU),
          "config: the graph's text file, for formats that have one. input_size: (width, height);\n"
          "None: the model's own. min_score, mask_threshold: 0 = the decoder's own, else to 1.\n"
          "backend, target: cv2.dnn.DNN_BACKEND_... and DNN_TARGET_...")
      .def_property_readonly("decoder", &Shared<OpenCvDnnSegmenter>::decoder,
                             "The decoder that fits, e.g. 'yolo_seg'.");
}
#endif

}  // namespace

void bind_segmenters(py::module_& m) {
  bind_detection_thread(m);
  bind_mask_files(m);
#ifdef STILLPOINT_WITH_OPENCV_DNN
  bind_opencv_dnn(m);
#endif
}

}  // namespace stillpoint::python
