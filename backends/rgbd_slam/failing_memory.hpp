// SPDX-License-Identifier: BSD-2-Clause
// Memory that runs out when a test says so. For the one test program that failing_memory.cpp is
// linked into.
#pragma once

namespace failing_memory {

/// The n-th `new` from now on throws std::bad_alloc, once; 0: none. Threads that are spared don't
/// count.
void fail_after(long n);

/// While it lives, the thread that made it is spared.
struct SpareThisThread {
  SpareThisThread();
  ~SpareThisThread();
  SpareThisThread(const SpareThisThread&) = delete;
  SpareThisThread& operator=(const SpareThisThread&) = delete;
};

}  // namespace failing_memory
