// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/core/selection.hpp"

#include <gtest/gtest.h>

#include <string>

namespace {

using stillpoint::KeypointReason;
using stillpoint::Selection;

TEST(Selection, CompactKeepsTheKeptInOrder) {
  Selection selection;
  selection.probability = {0, 1, 0, 0.3f, 0};
  selection.kept = {0, 2, 4};
  std::vector<std::string> names{"a", "b", "c", "d", "e"};
  stillpoint::compact(names, selection);
  EXPECT_EQ(names, (std::vector<std::string>{"a", "c", "e"}));
}

TEST(Selection, CompactKeepsAllOrNothing) {
  Selection selection;
  selection.probability = {0, 0};
  selection.kept = {0, 1};
  std::vector<int> values{7, 8};
  stillpoint::compact(values, selection);
  EXPECT_EQ(values, (std::vector<int>{7, 8}));
  selection.kept.clear();
  stillpoint::compact(values, selection);
  EXPECT_TRUE(values.empty());
  stillpoint::compact(values, selection);
  EXPECT_TRUE(values.empty());
}

TEST(Selection, SaysWhatIsKept) {
  Selection selection;
  selection.reason = {KeypointReason::kStatic, KeypointReason::kFloor, KeypointReason::kInMask,
                      KeypointReason::kProbable, KeypointReason::kOutsidePicture};
  std::vector<bool> kept;
  for (std::size_t i = 0; i < 5; ++i) kept.push_back(selection.is_kept(i));
  EXPECT_EQ(kept, (std::vector<bool>{true, true, false, false, false}));
  selection.probability.resize(5);
  EXPECT_EQ(selection.size(), 5u);
  selection.clear();
  EXPECT_EQ(selection.size(), 0u);
  EXPECT_TRUE(selection.reason.empty());
}

}  // namespace
