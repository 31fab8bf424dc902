// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include "synthetic/materials.hpp"

namespace stillpoint::synthetic {

/// Cloth for a shirt, a jacket or trousers: checks, stripes, knit, dots or plain with folds, with
/// an irregular weave so that it never repeats exactly. 512 texels per metre.
Canvas cloth(std::uint64_t seed, bool trousers);

/// A head: the face is in the middle, hair around and above. Wraps around the head.
Canvas face(std::uint64_t seed);

/// Skin of arms and hands, 512 texels per metre.
Canvas skin(std::uint64_t seed);

Canvas leather(std::uint64_t seed);

}  // namespace stillpoint::synthetic
