// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/backends/rgbd_slam/threads.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "failing_memory.hpp"
#include "slam_fixture.hpp"

namespace {

using namespace stillpoint;
using namespace stillpoint::rgbd_slam;
using namespace test_scene;

// Else who comes back at once would keep it from whoever waits.
TEST(FairMutex, GoesToWhoeverWaitedLongest) {
  FairMutex mutex;
  std::vector<int> order;
  std::vector<std::thread> others;
  std::unique_lock<FairMutex> mine(mutex);
  for (int i = 0; i < 3; ++i) {
    others.emplace_back([&, i] {
      const std::lock_guard<FairMutex> guard(mutex);
      order.push_back(i);
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(50));  // until it waits
  }
  mine.unlock();
  mine.lock();
  order.push_back(3);
  mine.unlock();
  for (std::thread& t : others) t.join();
  EXPECT_EQ(order, (std::vector<int>{0, 1, 2, 3}));
}

TEST(Worker, HandsOnWhatItsWorkThrowsOnceAndGoesOn) {
  std::vector<int> done;
  Worker worker([&](int item) {
    if (item == 2) throw Error("two");
    if (item == 3) throw std::runtime_error("only follows from the first");
    if (item == 6) throw 6;
    done.push_back(item);
  });
  EXPECT_NO_THROW(worker.rethrow());
  for (int i = 1; i <= 4; ++i) worker.push(i);
  worker.drain();
  try {
    worker.rethrow();
    ADD_FAILURE() << "nothing was thrown";
  } catch (const Error& e) {
    EXPECT_STREQ(e.what(), "stillpoint: two");
  }
  EXPECT_NO_THROW(worker.rethrow()) << "once";
  worker.push(5);
  worker.drain();
  EXPECT_NO_THROW(worker.rethrow());
  EXPECT_EQ(done, (std::vector<int>{1, 4, 5}));
  worker.push(6);  // and nobody asks: no harm when it ends
  worker.drain();
}

TEST(SlamSystem, ThreadsGiveTheSameWithinNoise) {
  SlamSystem slam(camera(), threaded_settings());
  walk(slam, 40);
  slam.finish();
  EXPECT_LT(worst_error(slam.trajectory()), 0.03);
}

// Memory that runs out in a thread, at any place, reaches the caller and does no other harm.
TEST(SlamSystem, HandsOnWhatItsThreadsThrowAndGoesOn) {
  cv::setNumThreads(1);  // no threads but ours ask for memory
  const failing_memory::SpareThisThread spared;
  std::vector<RgbdFrame> frames;
  for (int step = 0; step < 40; ++step) frames.push_back(render(path(3 * step), step * 0.1));
  SlamSystem::Settings settings = threaded_settings();
  settings.mapping.bundle_keyframes = 0;  // Ceres itself ends the process
  int failures = 0;
  // The further into the work it happens, the farther apart the places that are tried.
  for (int after = 1; after < 30000; after += 1 + after / 2) {
    SCOPED_TRACE(after);
    SlamSystem slam(camera(), settings);
    // Each of the two threads may have an Error to hand on; what fails so was not begun.
    const auto attempt = [&](const auto& call) {
      for (int tries = 0; tries < 3; ++tries) {
        try {
          return call();
        } catch (const Error& e) {
          ++failures;
          EXPECT_NE(std::string(e.what()).find(" of keyframe "), std::string::npos) << e.what();
          EXPECT_NE(std::string(e.what()).find("bad_alloc"), std::string::npos) << e.what();
          failing_memory::fail_after(0);
        }
      }
      ADD_FAILURE() << "more Errors than threads";
    };
    for (const RgbdFrame& frame : frames) {
      if (slam.keyframes() % 5 == 2) failing_memory::fail_after(after);
      std::size_t n = 0;
      attempt([&] { n = slam.extract(frame, DynamicMask()).size(); });
      attempt(
          [&] { EXPECT_TRUE(slam.track(frame, DynamicMask(), keep_all(n))) << frame.timestamp; });
    }
    attempt([&] { slam.finish(); });
    failing_memory::fail_after(0);
    EXPECT_EQ(slam.trajectory().size(), frames.size());
    EXPECT_LT(worst_error(slam.trajectory()), 0.05);
  }
  EXPECT_GT(failures, 20);
  cv::setNumThreads(-1);
}

}  // namespace
