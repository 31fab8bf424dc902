// SPDX-License-Identifier: BSD-2-Clause
#pragma once

/// Tells the compiler that pointers do not overlap, so that it can use vector instructions.
#if defined(__GNUC__) || defined(__clang__)
#define STILLPOINT_RESTRICT __restrict__
#elif defined(_MSC_VER)
#define STILLPOINT_RESTRICT __restrict
#else
#define STILLPOINT_RESTRICT
#endif
