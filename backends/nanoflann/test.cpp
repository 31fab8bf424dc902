// SPDX-License-Identifier: BSD-2-Clause
#include "stillpoint/backends/nanoflann_neighbor_search.hpp"
#include "stillpoint/testing/neighbor_search_conformance.hpp"

namespace stillpoint {
namespace testing {

STILLPOINT_TEST_NEIGHBOR_SEARCH(Nanoflann, NanoflannNeighborSearch);

}  // namespace testing
}  // namespace stillpoint
