// The clock of leases: it goes on while the machine sleeps and never jumps, whatever is done to the wall clock.
#pragma once

#include <ctime>

#include <chrono>

namespace woodcock {

/// Time since this machine booted, suspends included (CLOCK_BOOTTIME).
using BootTime = std::chrono::nanoseconds;

inline BootTime boot_now() {
  timespec now{};
  ::clock_gettime(CLOCK_BOOTTIME, &now);
  return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
}

}  // namespace woodcock
