// What takes minutes: 1e4 mean free paths in which nothing absorbs, and mean cosines next to ±1.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/hard_cases/slab.h"
#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

// A path scatters some ten thousand times. R + T within three standard errors; false alarms as in slabs_test.cpp.
TEST(HardCases, N43_nothing_is_lost_at_an_optical_depth_of_1e4) {
  for (const bool grid : {false, true}) {
    const reference::SlabCase slab{.tau = 1e4, .albedo = 1};
    const Estimate r = estimate(slab_scene(slab, SlabSide::kReflectance, grid), 2000, 3);
    const Estimate t = estimate(slab_scene(slab, SlabSide::kTransmittance, grid), 2000, 4);
    EXPECT_LE(std::abs(r.mean[1] + t.mean[1] - 1), 3 * std::hypot(r.error[1], t.error[1]) + kRounding)
        << "R " << r.mean[1] << " ± " << r.error[1] << ", T " << t.mean[1] << " ± " << t.error[1];
    EXPECT_EQ(r.counters.truncated + t.counters.truncated, 0u);
  }
}

}  // namespace
}  // namespace woodcock::testing
