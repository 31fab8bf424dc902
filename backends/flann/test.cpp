// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/backends/flann_neighbor_search.hpp"
#include "stillpoint/testing/neighbor_search_conformance.hpp"

namespace stillpoint {
namespace testing {

STILLPOINT_TEST_NEIGHBOR_SEARCH(Flann, FlannNeighborSearch);

}  // namespace testing
}  // namespace stillpoint
