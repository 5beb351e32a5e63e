// Ctrl-C and SIGTERM as a flag.
#pragma once

#include <atomic>

namespace woodcock {

/// Installs handlers for SIGINT and SIGTERM: the first signal sets the flag, a second one ends the program at once.
std::atomic<bool>& interrupt_flag();

}  // namespace woodcock
