// F32: a year of small jobs through retention.
#include "tests/service/fast_motion.h"

/// AddressSanitizer asks for this name. It keeps 256 MiB of freed memory back by default, which would count as growth here.
extern "C" const char* __asan_default_options() { return "quarantine_size_mb=1"; }

namespace woodcock::coordinator {
namespace {

TEST(FastMotion, F32_AHundredThousandSmallJobsLeaveTheMemoryFlat) {
  const FastMotion motion = fast_motion(100'000, 120, 7);
  EXPECT_LT(motion.memory_late - motion.memory_early, int64_t{8} << 20);
  EXPECT_LT(motion.database_late, motion.database_early * 5 / 4) << "rows that went make room for others";
}

}  // namespace
}  // namespace woodcock::coordinator
