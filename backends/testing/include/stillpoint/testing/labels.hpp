// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstdint>

/// How the synthetic sequence codes its label and limb images.
namespace stillpoint::synthetic {

/// Labels of movers begin here; people have 1, 2, ...
constexpr int kFirstMoverLabel = 101;

/// Limbs of a person, as stored in the limb image.
enum Limb : std::uint8_t {
  kNoLimb = 0,
  kTorso,
  kHead,
  kLeftArm,
  kRightArm,
  kLeftLeg,
  kRightLeg,
  kCarried
};

}  // namespace stillpoint::synthetic
