// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "stillpoint/testing/degraded_masks.hpp"
#include "stillpoint/testing/synthetic_sequence.hpp"

namespace stillpoint {

/// Called after each written frame with the number of frames done so far and of all; may come from
/// any thread, one at a time.
using SyntheticProgress = std::function<void(int done, int total)>;

struct SyntheticWriterOptions {
  /// Color as JPEG (quality 95) instead of PNG.
  bool jpeg = false;
  MaskDamage damage;
};

/// What was written, for a message and for tests.
struct SyntheticSummary {
  int frames = 0;
  /// Share of the picture that people (and movers) cover: mean and most.
  double mean_cover = 0, most_cover = 0;
  /// Share of the people's pixels that masks/ lost, and share of masks/ that is no person.
  double lost_share = 0, false_share = 0;
  /// Blur of the static world in pixels: mean over the frames, and of the people (by pixels).
  double camera_blur_px = 0, people_blur_px = 0;
};

namespace synthetic {

inline std::string stamp_text(double timestamp) {
  char text[40];
  std::snprintf(text, sizeof(text), "%.6f", timestamp);
  return text;
}

/// Opens a text file, calls write(stream), and throws Error when anything failed.
template <class Write>
void write_text(const std::filesystem::path& path, Write&& write) {
  std::ofstream stream(path, std::ios::binary);
  write(stream);
  stream.flush();
  detail::check(stream.good(), [&] {
    return "write_synthetic_sequence: could not write " + path.string() +
           "; is the disk full or the folder read-only?";
  });
}

inline void write_picture(const std::filesystem::path& path, const cv::Mat& picture,
                          const std::vector<int>& parameters) {
  bool good = false;
  try {
    good = cv::imwrite(path.string(), picture, parameters);
  } catch (const cv::Exception&) {
    good = false;
  }
  detail::check(good, [&] {
    return "write_synthetic_sequence: could not write " + path.string() +
           "; is the disk full or the folder read-only?";
  });
}

}  // namespace synthetic

/// Writes the sequence as a folder of the TUM layout: rgb/, depth/, rgb.txt, depth.txt,
/// associations.txt, groundtruth.txt (every 5 ms), camera.yaml; masks_gt/ (exact labels of all that
/// moves: people 1.., movers 101..), masks/ (people only, as a blur-stricken segmenter gives them,
/// see degrade_masks), movers_gt/ when there are movers, and blur.csv (per frame and label: pixels
/// and blur). Pictures are named by the timestamp. Existing files of the same names are replaced;
/// others stay. Frames are rendered with cv::parallel_for_; the files are the same for any number
/// of threads. Throws Error when something cannot be written.
inline SyntheticSummary write_synthetic_sequence(const std::string& folder,
                                                 const SyntheticSettings& settings,
                                                 const SyntheticProgress& progress = {},
                                                 const SyntheticWriterOptions& options = {}) {
  namespace fs = std::filesystem;
  using synthetic::stamp_text;
  const SyntheticSequence sequence(settings);
  const SyntheticSettings& s = sequence.settings();
  const fs::path root(folder);
  std::vector<std::string> parts{"rgb", "depth", "masks_gt", "masks"};
  if (s.movers > 0) parts.push_back("movers_gt");
  for (const std::string& part : parts) {
    std::error_code code;
    fs::create_directories(root / part, code);
    detail::check(!code, [&] {
      return "write_synthetic_sequence: could not make the folder " + (root / part).string() +
             ": " + code.message();
    });
  }
  const int n = sequence.frame_count();
  const std::string color_end = options.jpeg ? ".jpg" : ".png";

  synthetic::write_text(root / "camera.yaml", [&](std::ostream& out) {
    const Camera& c = sequence.camera();
    char text[640];
    std::snprintf(text, sizeof(text),
                  "%%YAML:1.0\nCamera.fx: %.6f\nCamera.fy: %.6f\nCamera.cx: %.6f\nCamera.cy: %.6f\n"
                  "Camera.k1: 0.0\nCamera.k2: 0.0\nCamera.p1: 0.0\nCamera.p2: 0.0\nCamera.k3: 0.0\n"
                  "Camera.width: %d\nCamera.height: %d\nCamera.fps: %.6f\nCamera.RGB: 1\n"
                  "DepthMapFactor: %.1f\nexposure_ms: %.3f\n",
                  c.fx, c.fy, c.cx, c.cy, c.width, c.height, c.fps, c.depth_units_per_m,
                  1000 * c.exposure_s);
    out << text
        << "# timestamps are mid-exposure; depth is registered to color, sharp at "
           "mid-exposure\n";
  });
  const auto list = [&](const char* name, const char* title, const std::string& part,
                        const std::string& end) {
    synthetic::write_text(root / name, [&](std::ostream& out) {
      out << "# " << title << "\n# file: synthetic\n# timestamp filename\n";
      for (int i = 0; i < n; ++i) {
        const std::string stamp = stamp_text(sequence.timestamp(i));
        out << stamp << ' ' << part << '/' << stamp << end << '\n';
      }
    });
  };
  list("rgb.txt", "color images", "rgb", color_end);
  list("depth.txt", "depth maps", "depth", ".png");
  synthetic::write_text(root / "associations.txt", [&](std::ostream& out) {
    for (int i = 0; i < n; ++i) {
      const std::string t = stamp_text(sequence.timestamp(i));
      out << t << " rgb/" << t << color_end << ' ' << t << " depth/" << t << ".png\n";
    }
  });
  synthetic::write_text(root / "groundtruth.txt", [&](std::ostream& out) {
    out << "# ground truth trajectory\n# file: synthetic\n# timestamp tx ty tz qx qy qz qw\n";
    const int steps = std::max(1, static_cast<int>(200 / s.fps + 0.5));
    char text[200];
    Eigen::Quaterniond last = Eigen::Quaterniond::Identity();
    for (int i = 0; i <= (n - 1) * steps; ++i) {
      const double after = std::floor(1e6 * (i % steps) / (s.fps * steps) + 0.5) * 1e-6;
      const Eigen::Isometry3d T = sequence.T_world_camera(sequence.seconds(i / steps) + after);
      const double t = sequence.timestamp(i / steps) + after;
      Eigen::Quaterniond q(T.linear());
      q.normalize();
      if (i == 0 ? q.w() < 0 : q.dot(last) < 0) q.coeffs() = -q.coeffs();
      last = q;
      std::snprintf(text, sizeof(text), "%.6f %.7f %.7f %.7f %.8f %.8f %.8f %.8f\n", t,
                    T.translation().x(), T.translation().y(), T.translation().z(), q.x(), q.y(),
                    q.z(), q.w());
      out << text;
    }
  });

  struct Row {
    std::vector<SyntheticBlur> blur;
    int moving = 0, people = 0, lost = 0, wrong = 0, masked = 0;
  };
  std::vector<Row> rows(static_cast<std::size_t>(n));
  std::mutex mutex;
  std::exception_ptr failure;
  int done = 0;
  const std::vector<int> fast_png{cv::IMWRITE_PNG_COMPRESSION, 1};
  const std::vector<int> color_parameters =
      options.jpeg ? std::vector<int>{cv::IMWRITE_JPEG_QUALITY, 95} : fast_png;
  const auto write_one = [&](int i) {
    const SyntheticFrame frame = sequence.frame(i);
    const std::string stamp = stamp_text(frame.timestamp);
    const cv::Mat masks = degrade_masks(
        frame.labels, frame.limbs, i,
        [&](int label, int k) { return sequence.expected_blur_px(label, k); },
        synthetic::hash(s.seed, 0xda3a9e), options.damage);
    synthetic::write_picture(root / "rgb" / (stamp + color_end), frame.color, color_parameters);
    synthetic::write_picture(root / "depth" / (stamp + ".png"), frame.depth, fast_png);
    synthetic::write_picture(root / "masks_gt" / (stamp + ".png"), frame.labels, fast_png);
    synthetic::write_picture(root / "masks" / (stamp + ".png"), masks, fast_png);
    Row& row = rows[static_cast<std::size_t>(i)];
    row.blur = frame.blur;
    cv::Mat movers(frame.labels.size(), CV_8UC1, cv::Scalar(0));
    for (int y = 0; y < masks.rows; ++y)
      for (int x = 0; x < masks.cols; ++x) {
        const int truth = frame.labels.at<uchar>(y, x);
        const bool person = truth > 0 && truth < synthetic::kFirstMoverLabel;
        const bool masked = masks.at<uchar>(y, x) != 0;
        row.moving += truth > 0, row.people += person, row.masked += masked;
        row.lost += person && !masked, row.wrong += masked && !person;
        if (truth >= synthetic::kFirstMoverLabel)
          movers.at<uchar>(y, x) = static_cast<uchar>(truth);
      }
    if (s.movers > 0)
      synthetic::write_picture(root / "movers_gt" / (stamp + ".png"), movers, fast_png);
  };
  cv::parallel_for_(
      cv::Range(0, n),
      [&](const cv::Range& range) {
        for (int i = range.start; i < range.end; ++i) {
          try {
            {
              std::lock_guard<std::mutex> lock(mutex);
              if (failure) return;
            }
            write_one(i);
            std::lock_guard<std::mutex> lock(mutex);
            ++done;
            if (progress) progress(done, n);
          } catch (...) {
            std::lock_guard<std::mutex> lock(mutex);
            if (!failure) failure = std::current_exception();
          }
        }
      },
      n);
  if (failure) std::rethrow_exception(failure);

  SyntheticSummary summary;
  summary.frames = n;
  double people = 0, lost = 0, wrong = 0, masked = 0, people_way = 0, people_pixels = 0;
  synthetic::write_text(root / "blur.csv", [&](std::ostream& out) {
    out << "timestamp,label,pixels,blur_px\n";
    char text[120];
    for (int i = 0; i < n; ++i) {
      const Row& row = rows[static_cast<std::size_t>(i)];
      for (const SyntheticBlur& b : row.blur) {
        std::snprintf(text, sizeof(text), "%.6f,%d,%d,%.3f\n", sequence.timestamp(i), b.label,
                      b.pixels, b.blur_px);
        out << text;
        if (b.label == 0) summary.camera_blur_px += b.blur_px / n;
        if (b.label > 0 && b.label < synthetic::kFirstMoverLabel)
          people_way += b.blur_px * b.pixels, people_pixels += b.pixels;
      }
      const double cover = row.moving / static_cast<double>(s.width * s.height);
      summary.mean_cover += cover / n, summary.most_cover = std::max(summary.most_cover, cover);
      people += row.people, lost += row.lost, wrong += row.wrong, masked += row.masked;
    }
  });
  summary.lost_share = people > 0 ? lost / people : 0;
  summary.false_share = masked > 0 ? wrong / masked : 0;
  summary.people_blur_px = people_pixels > 0 ? people_way / people_pixels : 0;
  return summary;
}

}  // namespace stillpoint
