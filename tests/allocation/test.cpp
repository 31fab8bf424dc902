// SPDX-License-Identifier: BSD-2-Clause
// After its first frames the front end keeps its images: what it allocates, the rows of OpenCV's
// filters and grids of cells, is less than a mask. Counted by operator new and OpenCV's default
// allocator, both replaced here.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdlib>
#include <new>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "../flat_scene.hpp"
#include "stillpoint/core/random.hpp"
#include "stillpoint/front_end.hpp"

namespace {

std::atomic<long> allocations{0}, allocated_bytes{0};

void* counted(std::size_t size, std::size_t alignment) {
  ++allocations;
  allocated_bytes += static_cast<long>(size);
  if (size == 0) size = 1;
  // aligned_alloc wants a multiple of the alignment.
  void* memory =
      alignment <= alignof(std::max_align_t)
          ? std::malloc(size)
          : std::aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
  if (!memory) throw std::bad_alloc();
  return memory;
}

#if CV_VERSION_MAJOR >= 4
using AccessFlag = cv::AccessFlag;
#else
using AccessFlag = int;
#endif

class CountingMatAllocator : public cv::MatAllocator {
 public:
  cv::UMatData* allocate(int dims, const int* sizes, int type, void* data, std::size_t* step,
                         AccessFlag flags, cv::UMatUsageFlags usage) const override {
    if (!data) {
      ++allocations;
      long bytes = CV_ELEM_SIZE(type);
      for (int i = 0; i < dims; ++i) bytes *= sizes[i];
      allocated_bytes += bytes;
    }
    return cv::Mat::getStdAllocator()->allocate(dims, sizes, type, data, step, flags, usage);
  }
  bool allocate(cv::UMatData* data, AccessFlag flags, cv::UMatUsageFlags usage) const override {
    ++allocations;
    return cv::Mat::getStdAllocator()->allocate(data, flags, usage);
  }
  void deallocate(cv::UMatData* data) const override {
    cv::Mat::getStdAllocator()->deallocate(data);
  }
};

// Not inlined, or compilers see std::free() where memory of `new` is given back.
[[gnu::noinline]] void release(void* p) noexcept { std::free(p); }

}  // namespace

void* operator new(std::size_t size) { return counted(size, 1); }
void* operator new[](std::size_t size) { return counted(size, 1); }
void* operator new(std::size_t size, std::align_val_t a) {
  return counted(size, static_cast<std::size_t>(a));
}
void* operator new[](std::size_t size, std::align_val_t a) {
  return counted(size, static_cast<std::size_t>(a));
}
void operator delete(void* p) noexcept { release(p); }
void operator delete[](void* p) noexcept { release(p); }
void operator delete(void* p, std::size_t) noexcept { release(p); }
void operator delete[](void* p, std::size_t) noexcept { release(p); }
void operator delete(void* p, std::align_val_t) noexcept { release(p); }
void operator delete[](void* p, std::align_val_t) noexcept { release(p); }
void operator delete(void* p, std::size_t, std::align_val_t) noexcept { release(p); }
void operator delete[](void* p, std::size_t, std::align_val_t) noexcept { release(p); }

namespace {

using namespace stillpoint;

// Two people who walk to and fro; everything that is given to the front end, made beforehand.
struct Scene {
  FlatScene room;
  std::vector<RgbdFrame> frames;
  std::vector<Segmentation> results;
  std::vector<std::vector<cv::KeyPoint>> keypoints;

  Scene(bool with_depth, bool bare_boxes) {
    room.height_m = 1.2f;
    room.with_depth = with_depth;
    RandomGenerator random(1);
    for (int i = 0; i < 48; ++i) {
      const int step = static_cast<int>(std::lround(40 * std::sin(i * 2 * 3.14159265 / 48)));
      const std::vector<Figure> people{{{80 + step, 79, 38, 139}, 3.2f, 1},
                                       {{200 - step, 70, 50, 160}, 2.4f, 2}};
      frames.push_back(room.frame(0, people));
      std::vector<Instance> seen;
      for (const Figure& f : people) seen.push_back(box_instance(f.box, room.size));
      if (bare_boxes)
        for (Instance& s : seen) s.mask = cv::Mat();
      if (i % 6 == 4) seen.erase(seen.begin());
      if (i % 6 == 5 && !bare_boxes) seen.back().mask(cv::Rect(0, 100, 25, 60)).setTo(0);
      results.push_back(i % 8 == 3 ? Segmentation() : result(seen));
      keypoints.emplace_back();
      for (int k = 0; k < 800 - 10 * (i % 5); ++k)
        keypoints.back().emplace_back(static_cast<float>(319 * random.uniform()),
                                      static_cast<float>(239 * random.uniform()), 31.0f);
    }
  }
};

struct Case {
  const char* name;
  bool paper, with_depth, bare_boxes, camera_motion;
};

class Allocation : public ::testing::TestWithParam<Case> {
  void SetUp() override {
    static CountingMatAllocator counting;
    cv::Mat::setDefaultAllocator(&counting);
  }
  void TearDown() override { cv::Mat::setDefaultAllocator(cv::Mat::getStdAllocator()); }
};

INSTANTIATE_TEST_SUITE_P(
    FrontEnd, Allocation,
    ::testing::Values(Case{"NetworkOnly", false, true, false, false},
                      Case{"Paper", true, true, false, false},
                      Case{"NetworkOnlyWithoutDepth", false, false, false, false},
                      Case{"PaperWithoutDepth", true, false, false, false},
                      Case{"NetworkOnlyBareBoxes", false, true, true, false},
                      Case{"NetworkOnlyWithCameraMotion", false, true, false, true}),
    [](const auto& i) { return i.param.name; });

constexpr long kMostBytes = 320 * 240;  // of a mask

TEST_P(Allocation, KeepsItsImagesAfterTheFirstFrames) {
  const Case& c = GetParam();
  const Scene scene(c.with_depth, c.bare_boxes);
  const FrontEndSettings settings =
      c.paper ? FrontEndSettings::paper() : FrontEndSettings::network_only();
  FrontEnd front_end(settings, scene.room.camera());
  std::optional<Eigen::Isometry3d> motion;
  if (c.camera_motion) motion = Eigen::Isometry3d::Identity();
  std::uint32_t status = 0;
  int restored = 0;
  for (int i = 0; i < 240; ++i) {
    const std::size_t k = static_cast<std::size_t>(i) % scene.frames.size();
    RgbdFrame frame = scene.frames[k];
    frame.timestamp = 1.3e9 + i / 30.0;
    const long before = allocated_bytes;
    front_end.compute_mask(frame, scene.results[k], motion);
    front_end.select(scene.keypoints[k]);
    const long bytes = allocated_bytes - before;
    if (i < 48) {
      if (i == 0) {
        EXPECT_GT(bytes, kMostBytes) << "the test must see allocations";
      }
      continue;  // every miss and every size was seen once
    }
    ASSERT_LT(bytes, kMostBytes) << "frame " << i;
    status |= front_end.stats().status;
    restored += front_end.stats().restored;
  }
  EXPECT_TRUE(status & kNoSegmentation);
  EXPECT_GT(restored, 20) << "the test must try restoring";
}

TEST(AllocationCounter, CountsPicturesAndVectors) {
  static CountingMatAllocator counting;
  cv::Mat::setDefaultAllocator(&counting);
  const long before = allocations;
  const cv::Mat image(10, 10, CV_8UC1);
  EXPECT_GT(allocations, before);
  cv::Mat::setDefaultAllocator(cv::Mat::getStdAllocator());
  const long between = allocations;
  const std::vector<int> numbers(100);
  EXPECT_GT(allocations, between);
}

}  // namespace
