// Where exceptions of a thread's work end: they are a fault of that work, never the end of the process.
#pragma once

#include <exception>
#include <optional>
#include <string>
#include <utility>

namespace woodcock::rpc {

/// Runs `work`. Returns what the exception says that ended it, nothing when it returned.
template <typename Work>
std::optional<std::string> failure_of(Work&& work) {
  try {
    std::forward<Work>(work)();
    return std::nullopt;
  } catch (const std::exception& error) {
    return error.what();
  } catch (...) {
    return "an exception of unknown type";
  }
}

}  // namespace woodcock::rpc
