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

/// For the operators of small vectors: a call costs more than what they do.
#if defined(__GNUC__) || defined(__clang__)
#define STILLPOINT_ALWAYS_INLINE inline __attribute__((always_inline))
#elif defined(_MSC_VER)
#define STILLPOINT_ALWAYS_INLINE __forceinline
#else
#define STILLPOINT_ALWAYS_INLINE inline
#endif

/// For loops over a row without branches: of these g++ makes vector instructions at -O2 (a build of
/// type RelWithDebInfo, Debian's, ROS 2's), too, not only at -O3. Not inlined, as g++ then forgets
/// STILLPOINT_RESTRICT and, at -O2, gives up.
#if defined(__GNUC__) && !defined(__clang__)
#define STILLPOINT_ROW_LOOP __attribute__((noinline, optimize("O3")))
#else
#define STILLPOINT_ROW_LOOP
#endif

/// Functions of a header whose code a program compiles itself, or, with STILLPOINT_COMPILED, has
/// from the library stillpoint::compiled.
#ifdef STILLPOINT_COMPILED
#define STILLPOINT_INLINE
#else
#define STILLPOINT_INLINE inline
#endif
