// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <string>
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

namespace detail {

using BlurPx = std::function<double(int label, int frame)>;

// What a blur-stricken segmenter misses in one frame, and how far its borders wander.
class LostLabels {
 public:
  LostLabels(const cv::Mat& labels, int frame, const BlurPx& blur_px, std::uint64_t seed,
             const MaskDamage& damage)
      : frame_(frame), seed_(seed), damage_(damage), lost_(kLabels * kLimbs), wander_px_(kLabels) {
    std::vector<int> pixels(kLabels, 0);
    for (int y = 0; y < labels.rows; ++y)
      for (int x = 0; x < labels.cols; ++x) ++pixels[labels.at<uchar>(y, x)];
    const double scale = labels.cols / 640.0;
    for (int label = 1; label < synthetic::kFirstMoverLabel; ++label)
      if (const int n = pixels[static_cast<std::size_t>(label)]) add(label, n, scale, blur_px);
  }

  /// The label that the segmenter gives where `label` is, of that limb.
  int kept(int label, int limb) const {
    if (label == 0 || label >= synthetic::kFirstMoverLabel) return 0;
    return lost_[static_cast<std::size_t>(label * kLimbs + limb % kLimbs)] ? 0 : label;
  }
  float wander_px(int label) const { return wander_px_[static_cast<std::size_t>(label)]; }

 private:
  static constexpr int kLabels = 256, kLimbs = 8;

  void add(int label, int pixels, double scale, const BlurPx& blur_px) {
    using namespace synthetic;
    std::vector<double> blur;  // of this frame and of those before, in pixels of a 640 wide image
    for (int back = 0; back < damage_.longest_spell; ++back)
      blur.push_back(blur_px(label, frame_ - back) / scale);
    const auto in_spell = [&](int what, double chance, double chance_per_px) {
      const std::uint64_t key = hash(seed_, number(label), number(what));
      for (int back = 0; back < damage_.longest_spell; ++back) {
        const std::uint64_t bits = hash(key, number(frame_ - back), 0x5e11);
        const int duration = 1 + static_cast<int>((bits & 0xffff) % number(damage_.longest_spell));
        const double p = chance + chance_per_px * blur[static_cast<std::size_t>(back)];
        if (duration > back && uniform(scramble(bits)) < std::min(p, 0.6)) return true;
      }
      return false;
    };
    const bool missing = pixels < damage_.smallest_pixels * scale * scale ||
                         in_spell(0, damage_.miss_chance, damage_.miss_chance_per_px);
    for (int limb = 0; limb < kLimbs; ++limb) {
      const bool may_lose = limb != kNoLimb && limb != kTorso && limb != kHead;
      lost_[static_cast<std::size_t>(label * kLimbs + limb)] =
          missing || (may_lose && in_spell(limb, damage_.limb_chance, damage_.limb_chance_per_px));
    }
    wander_px_[static_cast<std::size_t>(label)] = static_cast<float>(
        scale * std::min(9.0, damage_.border_px + damage_.border_px_per_px * blur[0]));
  }
  static std::uint64_t number(int i) { return static_cast<std::uint64_t>(i); }

  int frame_;
  std::uint64_t seed_;
  MaskDamage damage_;
  std::vector<char> lost_;        // by label and limb
  std::vector<float> wander_px_;  // by label
};

// Draws the labels with ragged borders: each pixel looks at a place moved by a field of noise,
// whose strength belongs to the nearest instance. 6-pixel waves on top of 22-pixel ones.
class RaggedLabels {
 public:
  RaggedLabels(const cv::Mat& labels, const cv::Mat& limbs, const LostLabels& lost,
               std::uint64_t field)
      : labels_(labels), limbs_(limbs), lost_(lost), field_(field), scale_(labels.cols / 640.0) {}

  cv::Mat draw() const {
    cv::Mat result(labels_.size(), CV_8UC1);
    for (int y = 0; y < labels_.rows; ++y)
      for (int x = 0; x < labels_.cols; ++x) {
        const float strength = strength_at(x, y);
        // A second look lets masks grow a little, as networks' do.
        int label = strength == 0 ? kept(x, y) : looked_up(x, y, strength, 0);
        if (strength != 0 && label == 0) label = looked_up(x, y, strength, 2);
        result.at<uchar>(y, x) = static_cast<uchar>(label);
      }
    return result;
  }

 private:
  int label_at(int x, int y) const {
    return labels_.at<uchar>(std::clamp(y, 0, labels_.rows - 1),
                             std::clamp(x, 0, labels_.cols - 1));
  }
  int kept(int x, int y) const {
    return lost_.kept(labels_.at<uchar>(y, x), limbs_.empty() ? 0 : limbs_.at<uchar>(y, x));
  }
  float strength_at(int x, int y) const {
    const int reach = std::max(1, static_cast<int>(10 * scale_));
    const float own = lost_.wander_px(label_at(x, y));
    if (own != 0) return own;
    return std::max(
        {lost_.wander_px(label_at(x + reach, y)), lost_.wander_px(label_at(x - reach, y)),
         lost_.wander_px(label_at(x, y + reach)), lost_.wander_px(label_at(x, y - reach))});
  }
  int looked_up(int x, int y, float strength, std::uint64_t which) const {
    const auto coarse = static_cast<float>(22 * scale_), fine = static_cast<float>(6 * scale_);
    const auto fx = static_cast<float>(x), fy = static_cast<float>(y);
    const auto moved_by = [&](std::uint64_t field) {
      using synthetic::value_noise;
      const float wide = value_noise(fx / coarse, fy / coarse, 4096, 4096, field) - 0.5f;
      const float near = value_noise(fx / fine, fy / fine, 4096, 4096, field + 4) - 0.5f;
      return strength * (3.2f * wide + 1.4f * near);
    };
    const int sx = static_cast<int>(fx + moved_by(field_ + which) + 1000.5f) - 1000;
    const int sy = static_cast<int>(fy + moved_by(field_ + which + 1) + 1000.5f) - 1000;
    return kept(std::clamp(sx, 0, labels_.cols - 1), std::clamp(sy, 0, labels_.rows - 1));
  }

  const cv::Mat &labels_, &limbs_;
  const LostLabels& lost_;
  std::uint64_t field_;
  double scale_;
};

}  // namespace detail

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
  detail::check(labels.type() == CV_8UC1, [&] {
    return "degrade_masks: labels: expected CV_8UC1, found type " + std::to_string(labels.type());
  });
  detail::check(limbs.empty() || (limbs.type() == CV_8UC1 && limbs.size() == labels.size()), [&] {
    return std::string("degrade_masks: limbs: expected CV_8UC1 of labels' size");
  });
  const detail::LostLabels lost(labels, frame, blur_px, seed, damage);
  const std::uint64_t field = synthetic::hash(seed, static_cast<std::uint64_t>(frame), 0xf1e1d);
  return detail::RaggedLabels(labels, limbs, lost, field).draw();
}

}  // namespace stillpoint
