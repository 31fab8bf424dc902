// SPDX-License-Identifier: BSD-2-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <stillpoint/backends/ros2/synchronizer.hpp>
#include <string>
#include <vector>

namespace {

using namespace stillpoint::ros2;

// Stamps in milliseconds from here on.
constexpr Nanoseconds kMs = 1000000;

ImageMessage image(std::int64_t ms) {
  ImageMessage m;
  m.stamp = ms * kMs;
  return m;
}
SegmentationMessage labels(std::int64_t ms) {
  SegmentationMessage m;
  m.stamp = ms * kMs;
  return m;
}

// What comes out: color+depth*segmentation, after a jump with that word.
std::string drain(Synchronizer& s) {
  std::string out;
  while (const std::optional<FrameMessages> f = s.next()) {
    const auto ms = [](Nanoseconds t) { return std::to_string(t / kMs); };
    out += (f->clock_jumped ? "jump " : "") + ms(f->color.stamp);
    out += f->depth ? "+" + ms(f->depth->stamp) : "";
    out += f->segmentation ? "*" + ms(f->segmentation->stamp) : "";
    out += " ";
  }
  return out;
}

TEST(Ros2Synchronizer, EqualStampsGoTogetherWhicheverComesFirst) {
  Synchronizer s;
  s.add_color(image(100));
  EXPECT_FALSE(s.ready());
  EXPECT_EQ(drain(s), "");
  s.add_depth(image(100));
  EXPECT_EQ(drain(s), "100+100 ");
  s.add_depth(image(133));
  s.add_color(image(133));
  EXPECT_EQ(drain(s), "133+133 ");
}

TEST(Ros2Synchronizer, TheNearestDepthIsTaken) {
  Synchronizer s;
  s.add_depth(image(90));
  s.add_color(image(100));
  EXPECT_EQ(drain(s), "") << "a nearer one may come";
  s.add_depth(image(104));
  EXPECT_EQ(drain(s), "100+104 ");
  s.add_color(image(133));
  s.add_depth(image(160));
  EXPECT_EQ(drain(s), "133 ") << "27 ms are too much";
  EXPECT_EQ(s.counts().without_depth, 1u);
}

TEST(Ros2Synchronizer, DepthShortlyBeforeItsColorIsNotKeptWaiting) {
  Synchronizer s;
  s.add_depth(image(995)), s.add_color(image(1000));
  EXPECT_EQ(drain(s), "") << "nobody knows yet when the next one comes";
  s.add_depth(image(1028)), s.add_color(image(1033));
  EXPECT_EQ(drain(s), "1000+995 1033+1028 ") << "33 ms after the last";
  s.add_depth(image(1061)), s.add_color(image(1066));
  EXPECT_EQ(drain(s), "1066+1061 ");
  s.add_depth(image(1127)), s.add_color(image(1132));  // one of each is lost
  EXPECT_EQ(drain(s), "1132+1127 ");
  s.add_depth(image(1160)), s.add_color(image(1178));
  EXPECT_EQ(drain(s), "") << "18 ms before: the next may be nearer";
  s.add_depth(image(1193));
  EXPECT_EQ(drain(s), "1178+1193 ");
}

TEST(Ros2Synchronizer, ADepthServesOneColorImage) {
  Synchronizer s;
  s.add_color(image(100));
  s.add_color(image(116));
  s.add_depth(image(117));
  EXPECT_EQ(drain(s), "100+117 116 ");
  s.add_color(image(133));
  s.add_depth(image(150));
  EXPECT_EQ(drain(s), "133+150 ");
  s.add_color(image(150));
  s.add_depth(image(190));
  EXPECT_EQ(drain(s), "150 ") << "that of 150 is used";
}

TEST(Ros2Synchronizer, ItTellsHowFarTheNearestDepthWas) {
  Synchronizer s;
  s.add_color(image(100));
  s.add_depth(image(145));
  EXPECT_EQ(s.next()->nearest_depth.value_or(0), 45 * kMs);
}

TEST(Ros2Synchronizer, MissingDepthIsWaitedForAndThenLeft) {
  SynchronizerSettings settings;
  settings.max_wait = 100 * kMs, settings.stalled_after = 500 * kMs;
  Synchronizer s(settings);
  s.add_color(image(1000));
  s.add_depth(image(1000));
  drain(s);
  for (const int t : {1033, 1066, 1100}) s.add_color(image(t));
  EXPECT_EQ(drain(s), "");
  s.add_color(image(1133));
  EXPECT_EQ(drain(s), "1033 ") << "100 ms have gone";
  // Half a second after the last depth nobody waits any more.
  for (int t = 1166; t < 1500; t += 33) s.add_color(image(t)), drain(s);
  s.add_color(image(1520));
  EXPECT_EQ(drain(s), "1397 1430 1463 1496 1520 ");
  s.add_color(image(1553));
  EXPECT_EQ(drain(s), "1553 ") << "at once";
  s.add_depth(image(1586));
  s.add_color(image(1586));
  EXPECT_EQ(drain(s), "1586+1586 ") << "it is back";
  s.add_color(image(1620));
  EXPECT_EQ(drain(s), "") << "and is waited for";
}

TEST(Ros2Synchronizer, WithoutUseOfDepthNothingWaits) {
  SynchronizerSettings settings;
  settings.depth = false;
  Synchronizer s(settings);
  s.add_depth(image(100));
  s.add_color(image(100));
  EXPECT_EQ(drain(s), "100 ");
  EXPECT_EQ(s.counts().without_depth, 0u);
}

TEST(Ros2Synchronizer, QueuesAreBounded) {
  SynchronizerSettings settings;
  settings.queue_size = 3;
  Synchronizer s(settings);
  for (int i = 1; i <= 100; ++i)
    s.add_color(image(10 * i)), s.add_depth(image(10 * i)), s.add_segmentation(labels(10 * i));
  EXPECT_EQ(s.counts().dropped, 97u);
  EXPECT_EQ(drain(s), "980+980*980 990+990*990 1000+1000*1000 ");
  // A full queue does not wait, or it would lose images that could be used.
  for (const int t : {1033, 1034, 1035}) s.add_color(image(t));
  EXPECT_EQ(drain(s), "1033 ");
  // Segmentations of a future that does not come.
  for (int i = 0; i < 100; ++i) s.add_segmentation(labels(100000 + i));
  s.add_color(image(200000));
  s.add_depth(image(200000));
  EXPECT_EQ(drain(s), "1034 1035 200000+200000*100099 ");
}

TEST(Ros2Synchronizer, LateAndRepeatedColorIsLeftOut) {
  Synchronizer s;
  s.add_color(image(1000)), s.add_depth(image(1000));
  s.add_color(image(1000)), s.add_color(image(990));
  s.add_depth(image(1000)), s.add_depth(image(990));
  s.add_color(image(1033)), s.add_depth(image(1033));
  EXPECT_EQ(drain(s), "1000+1000 1033+1033 ");
  EXPECT_EQ(s.counts().late, 2u);
  EXPECT_EQ(s.counts().jumps, 0u);
}

TEST(Ros2Synchronizer, TimeThatGoesBackBeginsAnew) {
  for (const bool depth_first : {false, true}) {
    Synchronizer s;
    for (int t = 5000; t < 5300; t += 33) s.add_color(image(t)), s.add_depth(image(t)), drain(s);
    s.add_color(image(5333));  // waits for its depth
    s.add_segmentation(labels(5300));
    for (int t = 100; t < 200; t += 33) {
      if (depth_first) s.add_depth(image(t));
      s.add_color(image(t));
      if (!depth_first) s.add_depth(image(t));
    }
    EXPECT_EQ(drain(s), "jump 100+100 133+133 166+166 199+199 ") << depth_first;
    EXPECT_EQ(s.counts().jumps, 1u);
  }
}

TEST(Ros2Synchronizer, AShortLoopIsSeenByManyOldStamps) {
  Synchronizer s;  // 0.5 s would be a jump; this bag has 0.3 s
  std::string all;
  for (int round = 0; round < 3; ++round)
    for (int t = 1000; t < 1300; t += 33) {
      s.add_color(image(t)), s.add_depth(image(t));
      all += drain(s);
    }
  EXPECT_EQ(s.counts().jumps, 2u) << all;
  EXPECT_GT(s.counts().frames, 15u);
}

TEST(Ros2Synchronizer, LateSegmentationsComeWithTheNextFrame) {
  Synchronizer s;
  s.add_color(image(1000)), s.add_depth(image(1000));
  EXPECT_EQ(drain(s), "1000+1000 ") << "none is waited for";
  s.add_segmentation(labels(967));
  s.add_segmentation(labels(1000));
  s.add_color(image(1033)), s.add_depth(image(1033));
  s.add_color(image(1066)), s.add_depth(image(1066));
  EXPECT_EQ(drain(s), "1033+1033*1000 1066+1066 ") << "the newest, once";
}

TEST(Ros2Synchronizer, SegmentationsOfTheSameStampCanBeWaitedFor) {
  SynchronizerSettings settings;
  settings.mask_wait = 80 * kMs;
  Synchronizer s(settings);
  const auto frame = [&](int t) { s.add_color(image(t)), s.add_depth(image(t)); };
  frame(1000);
  EXPECT_EQ(drain(s), "");
  frame(1033);
  s.add_segmentation(labels(1000));
  EXPECT_EQ(drain(s), "1000+1000*1000 ");
  s.add_segmentation(labels(1066));
  EXPECT_EQ(drain(s), "1033+1033 ") << "the network left one out";
  frame(1066);
  EXPECT_EQ(drain(s), "1066+1066*1066 ");
  for (const int t : {1100, 1133}) frame(t);
  EXPECT_EQ(drain(s), "");
  frame(1185);
  EXPECT_EQ(drain(s), "1100+1100 ") << "80 ms have gone";
}

// Each topic keeps its order; whichever comes first, the frames are the same.
TEST(Ros2Synchronizer, TheOrderOfArrivalChangesNothing) {
  std::mt19937 random(3);
  std::vector<std::int64_t> colors, depths;
  for (int i = 0; i < 200; ++i) {
    if (random() % 10 > 0) colors.push_back(1000 + 33 * i);
    if (random() % 10 > 0)
      depths.push_back(1000 + 33 * i + static_cast<std::int64_t>(random() % 31) - 15);
  }
  SynchronizerSettings settings;
  settings.queue_size = 20, settings.max_wait = 300 * kMs;
  std::string expected;
  for (int trial = 0; trial < 20; ++trial) {
    Synchronizer s(settings);
    std::string all;
    std::size_t c = 0, d = 0;
    while (c < colors.size() || d < depths.size()) {
      // At most 150 ms apart.
      const bool color_ahead =
          c < colors.size() && d < depths.size() && colors[c] > depths[d] + 150;
      const bool depth_ahead =
          c < colors.size() && d < depths.size() && depths[d] > colors[c] + 150;
      const bool color =
          d == depths.size() || depth_ahead || (c < colors.size() && !color_ahead && random() % 2);
      if (color)
        s.add_color(image(colors[c++]));
      else
        s.add_depth(image(depths[d++]));
      if (random() % 2) all += drain(s);
    }
    s.add_depth(image(100000));
    all += drain(s);
    if (trial == 0) expected = all;
    EXPECT_TRUE(all == expected) << trial;
    EXPECT_EQ(s.counts().dropped, 0u);
  }
  EXPECT_NE(expected.find('+'), std::string::npos);
}

}  // namespace
