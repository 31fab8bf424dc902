// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <vector>

#include "stillpoint/core/error.hpp"
#include "stillpoint/testing/labels.hpp"
#include "stillpoint/testing/noise.hpp"

namespace stillpoint {

/// How a segmenter fails under motion blur. Chances are per instance and frame.
struct MaskDamage {
  /// A spell of frames in which the whole instance is missing begins with this chance on a sharp
  /// image, and more per pixel of blur.
  double miss_chance = 0.002, miss_chance_per_px = 0.0021;
  /// The same for one limb (or the carried object).
  double limb_chance = 0.008, limb_chance_per_px = 0.0034;
  /// Spells last 1 to this many frames.
  int longest_spell = 5;
  /// Borders wander by about this many pixels, and more per pixel of blur (at 640 wide).
  double border_px = 1.6, border_px_per_px = 0.10;
  /// Instances of fewer pixels are always missed (at 640 x 480).
  int smallest_pixels = 60;
};

/// Gives masks as a blur-stricken segmenter would give them: whole instances missing, limbs
/// missing, ragged borders.
///
/// `labels`: CV_8UC1, 0 = background, k = instance k, exact. `limbs`: CV_8UC1 with the limb of each
/// pixel (synthetic::Limb), or empty: no limb is lost. `blur_px(label, frame)`: blur of an instance
/// in pixels, also asked for the frames just before this one (numbers may be negative), because
/// misses come in spells. Labels of 101 and above are left out: no segmenter knows movers. The
/// result depends on the arguments alone. O(pixels).
inline cv::Mat degrade_masks(const cv::Mat& labels, const cv::Mat& limbs, int frame,
                             const std::function<double(int, int)>& blur_px, std::uint64_t seed = 1,
                             const MaskDamage& damage = MaskDamage()) {
  using namespace synthetic;
  detail::check(labels.type() == CV_8UC1, [&] {
    return "degrade_masks: labels: expected CV_8UC1, found type " + std::to_string(labels.type());
  });
  detail::check(limbs.empty() || (limbs.type() == CV_8UC1 && limbs.size() == labels.size()), [&] {
    return std::string("degrade_masks: limbs: expected CV_8UC1 of labels' size");
  });
  constexpr int kLabels = 256, kLimbs = 8;
  std::vector<int> pixels(kLabels, 0);
  for (int y = 0; y < labels.rows; ++y)
    for (int x = 0; x < labels.cols; ++x) ++pixels[labels.at<uchar>(y, x)];

  const auto number = [](int i) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(i));
  };
  const double scale = labels.cols / 640.0;
  std::vector<char> lost(kLabels * kLimbs, 0);
  std::vector<float> wander(kLabels, 0);
  for (int label = 1; label < kFirstMoverLabel; ++label) {
    if (pixels[static_cast<std::size_t>(label)] == 0) continue;
    // Blur counts in pixels of a 640 wide image.
    std::vector<double> blur;
    for (int back = 0; back < damage.longest_spell; ++back)
      blur.push_back(blur_px(label, frame - back) / scale);
    const auto in_spell = [&](int what, double chance, double chance_per_px) {
      for (int back = 0; back < damage.longest_spell; ++back) {
        const std::uint64_t bits =
            hash(hash(seed, number(label), number(what)), number(frame - back), 0x5e11);
        const int duration = 1 + static_cast<int>((bits & 0xffff) % number(damage.longest_spell));
        const double p = chance + chance_per_px * blur[static_cast<std::size_t>(back)];
        if (duration > back && uniform(scramble(bits)) < std::min(p, 0.6)) return true;
      }
      return false;
    };
    const bool missing =
        pixels[static_cast<std::size_t>(label)] < damage.smallest_pixels * scale * scale ||
        in_spell(0, damage.miss_chance, damage.miss_chance_per_px);
    for (int limb = 0; limb < kLimbs; ++limb) {
      const bool may_lose = limb != kNoLimb && limb != kTorso && limb != kHead;
      lost[static_cast<std::size_t>(label * kLimbs + limb)] =
          missing || (may_lose && in_spell(limb, damage.limb_chance, damage.limb_chance_per_px));
    }
    wander[static_cast<std::size_t>(label)] = static_cast<float>(
        scale * std::min(9.0, damage.border_px + damage.border_px_per_px * blur[0]));
  }

  const auto kept = [&](int x, int y) {
    const int label = labels.at<uchar>(y, x);
    if (label == 0 || label >= kFirstMoverLabel) return 0;
    const int limb = limbs.empty() ? 0 : limbs.at<uchar>(y, x) % kLimbs;
    return lost[static_cast<std::size_t>(label * kLimbs + limb)] ? 0 : label;
  };
  // Ragged borders: each pixel looks at a place moved by a field of noise, whose strength belongs
  // to the nearest instance. 6-pixel waves on top of 22-pixel ones.
  const std::uint64_t field = hash(seed, number(frame), 0xf1e1d);
  const auto coarse = static_cast<float>(22 * scale), fine = static_cast<float>(6 * scale);
  cv::Mat result(labels.size(), CV_8UC1);
  const int reach = std::max(1, static_cast<int>(10 * scale));
  for (int y = 0; y < labels.rows; ++y)
    for (int x = 0; x < labels.cols; ++x) {
      float strength = wander[labels.at<uchar>(y, x)];
      if (strength == 0)
        for (int i = 0; i < 4; ++i) {
          const int nx = std::clamp(x + (i == 0 ? reach : i == 1 ? -reach : 0), 0, labels.cols - 1);
          const int ny = std::clamp(y + (i == 2 ? reach : i == 3 ? -reach : 0), 0, labels.rows - 1);
          strength = std::max(strength, wander[labels.at<uchar>(ny, nx)]);
        }
      if (strength == 0) {
        result.at<uchar>(y, x) = static_cast<uchar>(kept(x, y));
        continue;
      }
      const auto fx = static_cast<float>(x), fy = static_cast<float>(y);
      const auto moved_by = [&](std::uint64_t which) {
        const float wide = value_noise(fx / coarse, fy / coarse, 4096, 4096, field + which) - 0.5f;
        const float near = value_noise(fx / fine, fy / fine, 4096, 4096, field + which + 4) - 0.5f;
        return strength * (3.2f * wide + 1.4f * near);
      };
      const auto looked_up = [&](std::uint64_t which) {
        const int sx = static_cast<int>(fx + moved_by(which) + 1000.5f) - 1000;
        const int sy = static_cast<int>(fy + moved_by(which + 1) + 1000.5f) - 1000;
        return kept(std::clamp(sx, 0, labels.cols - 1), std::clamp(sy, 0, labels.rows - 1));
      };
      // A second look lets masks grow a little, as networks' do.
      int label = looked_up(0);
      if (label == 0) label = looked_up(2);
      result.at<uchar>(y, x) = static_cast<uchar>(label);
    }
  return result;
}

}  // namespace stillpoint
