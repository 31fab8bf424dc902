// SPDX-License-Identifier: BSD-2-Clause
#pragma once

// The whole library but what reads files (stillpoint/io/, needs imgcodecs) and what tests use
// (stillpoint/testing/).
#include "stillpoint/core/camera.hpp"
#include "stillpoint/core/error.hpp"
#include "stillpoint/core/frame.hpp"
#include "stillpoint/core/instance.hpp"
#include "stillpoint/core/keypoint.hpp"
#include "stillpoint/core/mask.hpp"
#include "stillpoint/core/selection.hpp"
#include "stillpoint/core/status.hpp"
#include "stillpoint/core/trajectory.hpp"
#include "stillpoint/depth/depth_mask_fuser.hpp"
#include "stillpoint/front_end.hpp"
#include "stillpoint/keypoints/grid_neighbor_search.hpp"
#include "stillpoint/keypoints/probabilistic_keypoint_filter.hpp"
#include "stillpoint/segmentation/segmentation_compensator.hpp"
#include "stillpoint/segmentation/segmenter.hpp"
#include "stillpoint/tracking/tracker.hpp"
#include "stillpoint/version.hpp"
