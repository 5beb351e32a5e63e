// How much memory this process may use.
#pragma once

#include <cstdint>

namespace woodcock::rpc {

/// Bytes of this machine's memory, or of the limit of this process's control group where that is less; 0 where neither is known.
int64_t machine_memory();

}  // namespace woodcock::rpc
