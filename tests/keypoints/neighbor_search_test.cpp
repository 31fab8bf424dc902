// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/testing/neighbor_search_conformance.hpp"

namespace stillpoint {
namespace testing {

STILLPOINT_TEST_NEIGHBOR_SEARCH(Grid, GridNeighborSearch);

TEST(NeighborSearchDefinition, CountsTheRadiusAsInside) {
  const std::vector<cv::Point2f> points{{3, 4}, {3, 4.001f}, {0, 0}};
  EXPECT_EQ(expected_neighbors(points, {0, 0}, 5), (std::vector<int>{0, 2}));
}

}  // namespace testing
}  // namespace stillpoint
