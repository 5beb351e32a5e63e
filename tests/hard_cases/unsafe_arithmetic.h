#pragma once

namespace woodcock::testing {

/// arithmetic_fault() as code built with -ffast-math answers it.
const char* fault_of_fast_arithmetic();

}  // namespace woodcock::testing
