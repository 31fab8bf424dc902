// SPDX-License-Identifier: BSD-2-Clause
#include <stillpoint/backends/orb_slam2.hpp>

#include "../../tests/stand_ins/orb_slam2/System.h"

static_assert(__cplusplus < 201703L, "the host's language is C++14");
using Slam = ORB_SLAM2::System;
using stillpoint::orb_slam2::track_rgbd;

#define ORB_SLAM_TEST(name) TEST(OrbSlam2, name)
#include "../../tests/stand_ins/orb_slam_test.hpp"
