// F32: a year of small jobs through retention.
#include "tests/service/fast_motion.h"
#include "tests/support/little_kept_back.h"

namespace woodcock::coordinator {
namespace {

TEST(FastMotion, F32_AHundredThousandSmallJobsLeaveTheMemoryFlat) {
  const FastMotion motion = fast_motion(100'000, 120, 7);
  EXPECT_LT(motion.memory_late - motion.memory_early, int64_t{8} << 20);
  EXPECT_LT(motion.database_late, motion.database_early * 5 / 4) << "rows that went make room for others";
}

}  // namespace
}  // namespace woodcock::coordinator
