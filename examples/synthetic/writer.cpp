// SPDX-License-Identifier: BSD-2-Clause
#include "synthetic/writer.hpp"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <system_error>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/io/image_file.hpp"
#include "stillpoint/io/text_file.hpp"

namespace stillpoint {
namespace {

namespace fs = std::filesystem;

/// Pixels of one frame by what they are and what masks/ says of them.
struct FrameCounts {
  std::vector<SyntheticBlur> blur;
  int moving = 0, people = 0, lost = 0, wrong = 0, masked = 0;
};

class FolderWriter {
 public:
  FolderWriter(const std::string& folder, const SyntheticSettings& settings,
               const SyntheticWriterOptions& options)
      : root_(folder),
        sequence_(settings),
        options_(options),
        color_end_(options.jpeg ? ".jpg" : ".png") {}

  SyntheticSummary write(const SyntheticProgress& progress) {
    make_folders();
    write_camera();
    write_list("rgb.txt", "color images", "rgb", color_end_);
    write_list("depth.txt", "depth maps", "depth", ".png");
    write_associations();
    write_trajectory();
    write_frames(progress);
    return write_blur();
  }

 private:
  int frame_count() const { return sequence_.frame_count(); }
  bool has_movers() const { return sequence_.settings().movers > 0; }
  /// The name of a frame's images, without their ending.
  std::string stem(int i) const { return detail::seconds_text(sequence_.timestamp(i)); }
  void write_text(const char* name, const std::string& text) const {
    write_file(root_ / name, text, "synthetic sequence: file");
  }
  void write_image(const char* part, const std::string& name, const cv::Mat& image,
                   const std::vector<int>& parameters) const {
    stillpoint::write_image(root_ / part / name, image, parameters);
  }

  void make_folders() const {
    std::vector<std::string> parts{"rgb", "depth", "masks_gt", "masks"};
    if (has_movers()) parts.push_back("movers_gt");
    for (const std::string& part : parts) {
      std::error_code code;
      fs::create_directories(root_ / part, code);
      detail::check(!code, [&] {
        return "write_synthetic_sequence: could not make the folder " + (root_ / part).string() +
               ": " + code.message();
      });
    }
  }

  void write_camera() const {
    const Camera& c = sequence_.camera();
    char text[640];
    std::snprintf(text, sizeof(text),
                  "%%YAML:1.0\nCamera.fx: %.6f\nCamera.fy: %.6f\nCamera.cx: %.6f\nCamera.cy: %.6f\n"
                  "Camera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.k3: 0.0\n"
                  "Camera.width: %d\nCamera.height: %d\nCamera.fps: %.6f\nCamera.RGB: 1\n"
                  "DepthMapFactor: %.1f\nexposure_ms: %.3f\n",
                  c.fx, c.fy, c.cx, c.cy, c.width, c.height, c.fps, c.depth_units_per_m,
                  1000 * c.exposure_s);
    write_text("camera.yaml", std::string(text) +
                                  "# timestamps are mid-exposure; depth is registered to color, "
                                  "sharp at mid-exposure\n");
  }

  void write_list(const char* name, const char* title, const std::string& part,
                  const std::string& end) const {
    std::string text = std::string("# ") + title + "\n# file: synthetic\n# timestamp filename\n";
    for (int i = 0; i < frame_count(); ++i)
      text += stem(i) + ' ' + part + '/' + stem(i) + end + '\n';
    write_text(name, text);
  }

  void write_associations() const {
    std::string text;
    for (int i = 0; i < frame_count(); ++i) {
      const std::string t = stem(i);
      text += t + " rgb/" + t + color_end_ + ' ' + t + " depth/" + t + ".png\n";
    }
    write_text("associations.txt", text);
  }

  /// A pose every 5 ms, without a jump in the quaternion's sign.
  void write_trajectory() const {
    std::string text =
        "# ground truth trajectory\n# file: synthetic\n# timestamp tx ty tz qx qy qz qw\n";
    const double fps = sequence_.settings().fps;
    const int steps = std::max(1, static_cast<int>(200 / fps + 0.5));
    char line[200];
    Eigen::Quaterniond last = Eigen::Quaterniond::Identity();
    for (int i = 0; i <= (frame_count() - 1) * steps; ++i) {
      const double after = std::floor(1e6 * (i % steps) / (fps * steps) + 0.5) * 1e-6;
      const Eigen::Isometry3d T = sequence_.T_world_camera(sequence_.seconds(i / steps) + after);
      const double t = sequence_.timestamp(i / steps) + after;
      Eigen::Quaterniond q(T.linear());
      q.normalize();
      if (i == 0 ? q.w() < 0 : q.dot(last) < 0) q.coeffs() = -q.coeffs();
      last = q;
      std::snprintf(line, sizeof(line), "%.6f %.7f %.7f %.7f %.8f %.8f %.8f %.8f\n", t,
                    T.translation().x(), T.translation().y(), T.translation().z(), q.x(), q.y(),
                    q.z(), q.w());
      text += line;
    }
    write_text("groundtruth.txt", text);
  }

  /// In OpenCV's threads; an exception of one of them is thrown again at the end.
  void write_frames(const SyntheticProgress& progress) {
    const int n = frame_count();
    counts_.resize(static_cast<std::size_t>(n));
    std::mutex mutex;
    std::exception_ptr failure;
    int done = 0;
    const auto write_next = [&](int i) {
      try {
        {
          std::lock_guard<std::mutex> lock(mutex);
          if (failure) return;
        }
        write_frame(i);
        std::lock_guard<std::mutex> lock(mutex);
        ++done;
        if (progress) progress(done, n);
      } catch (...) {
        std::lock_guard<std::mutex> lock(mutex);
        if (!failure) failure = std::current_exception();
      }
    };
    cv::parallel_for_(
        cv::Range(0, n),
        [&](const cv::Range& range) {
          for (int i = range.start; i < range.end; ++i) write_next(i);
        },
        n);
    if (failure) std::rethrow_exception(failure);
  }

  void write_frame(int i) {
    const SyntheticFrame frame = sequence_.frame(i);
    const cv::Mat masks = degraded_masks(sequence_, frame, i, options_.damage);
    const std::vector<int> png{cv::IMWRITE_PNG_COMPRESSION, 1};  // fast
    const std::vector<int> jpeg{cv::IMWRITE_JPEG_QUALITY, 95};
    write_image("rgb", stem(i) + color_end_, frame.color, options_.jpeg ? jpeg : png);
    write_image("depth", stem(i) + ".png", frame.depth, png);
    write_image("masks_gt", stem(i) + ".png", frame.labels, png);
    write_image("masks", stem(i) + ".png", masks, png);
    if (has_movers()) {
      cv::Mat movers = frame.labels.clone();
      movers.setTo(0, frame.labels < synthetic::kFirstMoverLabel);
      write_image("movers_gt", stem(i) + ".png", movers, png);
    }
    FrameCounts& counts = counts_[static_cast<std::size_t>(i)];
    const cv::Mat moves = frame.labels > 0, masked = masks > 0;
    const cv::Mat person = moves & (frame.labels < synthetic::kFirstMoverLabel);
    counts.blur = frame.blur;
    counts.moving = cv::countNonZero(moves), counts.people = cv::countNonZero(person);
    counts.masked = cv::countNonZero(masked);
    const int found = cv::countNonZero(person & masked);
    counts.lost = counts.people - found, counts.wrong = counts.masked - found;
  }

  SyntheticSummary write_blur() const {
    const int n = frame_count();
    const double image_pixels =
        static_cast<double>(sequence_.camera().width * sequence_.camera().height);
    SyntheticSummary summary;
    summary.frames = n;
    double people = 0, lost = 0, wrong = 0, masked = 0, displacement = 0, pixels = 0;
    std::string text = "timestamp,label,pixels,blur_px\n";
    char line[120];
    for (int i = 0; i < n; ++i) {
      const FrameCounts& counts = counts_[static_cast<std::size_t>(i)];
      for (const SyntheticBlur& b : counts.blur) {
        std::snprintf(line, sizeof(line), "%.6f,%d,%d,%.3f\n", sequence_.timestamp(i), b.label,
                      b.pixels, b.blur_px);
        text += line;
        if (b.label == 0) summary.camera_blur_px += b.blur_px / n;
        if (b.label > 0 && b.label < synthetic::kFirstMoverLabel)
          displacement += b.blur_px * b.pixels, pixels += b.pixels;
      }
      const double cover = counts.moving / image_pixels;
      summary.mean_cover += cover / n, summary.most_cover = std::max(summary.most_cover, cover);
      people += counts.people, lost += counts.lost;
      wrong += counts.wrong, masked += counts.masked;
    }
    write_text("blur.csv", text);
    summary.lost_share = people > 0 ? lost / people : 0;
    summary.false_share = masked > 0 ? wrong / masked : 0;
    summary.people_blur_px = pixels > 0 ? displacement / pixels : 0;
    return summary;
  }

  fs::path root_;
  SyntheticSequence sequence_;
  SyntheticWriterOptions options_;
  std::string color_end_;
  std::vector<FrameCounts> counts_;
};

}  // namespace

SyntheticSummary write_synthetic_sequence(const std::string& folder,
                                          const SyntheticSettings& settings,
                                          const SyntheticProgress& progress,
                                          const SyntheticWriterOptions& options) {
  return FolderWriter(folder, settings, options).write(progress);
}

}  // namespace stillpoint
