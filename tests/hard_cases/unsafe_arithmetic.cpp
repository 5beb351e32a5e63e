// Built with -ffast-math, to see that the renderer's question to its own arithmetic finds it. The header is included under
// another namespace, so that the linker cannot take this copy of the inline function for the safe one.
#include "tests/hard_cases/unsafe_arithmetic.h"

#define woodcock woodcock_fast
#include "renderer/core/arithmetic.h"
#undef woodcock

const char* woodcock::testing::fault_of_fast_arithmetic() { return woodcock_fast::arithmetic_fault(); }
