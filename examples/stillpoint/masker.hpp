// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <opencv2/core.hpp>
#include <utility>
#include <vector>

#include "stillpoint/depth/depth_mask_fuser.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/segmentation/segmenter.hpp"

namespace stillpoint::cli {

/// The frames' masks, by the whole front end or by the segmenter alone.
class Masker {
 public:
  Masker(const FrontEndSettings& settings, const Camera& camera, Segmenter* segmenter,
         bool network_only)
      : network_only_(network_only),
        segmenter_(segmenter),
        classes_(settings.dynamic_classes),
        fuser_(undilated(settings.depth), camera),
        front_end_(settings, camera, segmenter) {}

  /// False: the segmenter alone has no result for this frame.
  bool process(const RgbdFrame& frame) {
    if (network_only_) return ask_segmenter(frame);
    dynamic_ = front_end_.compute_mask(frame).image;
    instances_ = front_end_.instances();
    return true;
  }

  const cv::Mat& dynamic() const { return dynamic_; }
  const std::vector<Instance>& instances() const { return instances_; }
  const std::vector<DynamicObject>& objects() const { return front_end_.objects(); }
  /// Of the front end; nothing in it with `network_only`.
  const FrameStats& stats() const { return front_end_.stats(); }

 private:
  static DepthMaskFuserSettings undilated(DepthMaskFuserSettings settings) {
    settings.dilation_px = 0;
    settings.dilation_per_blur_px = 0;
    return settings;
  }

  bool ask_segmenter(const RgbdFrame& frame) {
    Segmentation result = segmenter_->segment(frame);
    instances_.clear();
    bool bare = false;
    for (Instance& s : result.instances)
      if (is_dynamic(s, classes_)) {
        bare = bare || s.mask.empty();
        instances_.push_back(std::move(s));
      }
    if (bare) {  // a detector's boxes are filled by the depth in them
      result.instances = instances_;
      fuser_.fuse(frame, result);
      for (std::size_t i = 0; i < instances_.size(); ++i)
        if (instances_[i].mask.empty()) instances_[i] = fuser_.instances()[i];
    }
    dynamic_ = mask_from_instances(instances_, frame.color.size());
    return result.available;
  }

  bool network_only_;
  Segmenter* segmenter_;
  std::vector<DynamicClass> classes_;
  DepthMaskFuser fuser_;
  FrontEnd front_end_;
  cv::Mat dynamic_;
  std::vector<Instance> instances_;
};

}  // namespace stillpoint::cli
