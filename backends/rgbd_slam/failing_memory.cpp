// SPDX-License-Identifier: BSD-2-Clause
#include "failing_memory.hpp"

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <new>

namespace failing_memory {
namespace {

std::atomic<long> left{0};
thread_local bool spared = false;

bool fails_now() {
  if (spared || left.load(std::memory_order_relaxed) <= 0) return false;
  return left.fetch_sub(1) == 1;
}

}  // namespace

void fail_after(long n) { left = n; }
SpareThisThread::SpareThisThread() { spared = true; }
SpareThisThread::~SpareThisThread() { spared = false; }

}  // namespace failing_memory

// All forms, so that none of a sanitizer's own is mixed with these.
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return failing_memory::fails_now() ? nullptr : std::malloc(size > 0 ? size : 1);
}
void* operator new(std::size_t size) {
  void* memory = operator new(size, std::nothrow);
  if (!memory) throw std::bad_alloc();
  return memory;
}
void* operator new[](std::size_t size) { return operator new(size); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept {
  return operator new(size, std::nothrow);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
