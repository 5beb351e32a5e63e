// The log of a program that runs for long.
#pragma once

#include <string>

namespace woodcock::rpc {

/// Sets spdlog up to write to standard error in this pattern. Each record is one line, whatever names it holds: rpc/printable.h.
void start_log(const std::string& name, const std::string& pattern);

}  // namespace woodcock::rpc
