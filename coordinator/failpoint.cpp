#include "coordinator/failpoint.h"

#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cstdio>
#include <memory>
#include <stdexcept>

#include "coordinator/failpoint_names.h"

namespace woodcock::coordinator {

std::span<const char* const> failpoints() { return kFailpointNames; }

Failpoint kill_at(const std::string& text) {
  const size_t at = text.find('@');
  const std::string point = text.substr(0, at);
  int count = 0;
  if (at != std::string::npos) {
    const auto [end, error] = std::from_chars(text.data() + at + 1, text.data() + text.size(), count);
    if (error != std::errc{} || end != text.data() + text.size()) count = 0;
  }
  if (count < 1 || std::find(failpoints().begin(), failpoints().end(), point) == failpoints().end()) {
    std::string names;
    for (const char* name : failpoints()) names += std::string(" ") + name;
    throw std::invalid_argument("--test-hook: expected POINT@N with N from 1, found \"" + text + "\"; the points are" + names);
  }
  return [point, count, passed = std::make_shared<std::atomic<int>>(0)](const char* here) {
    if (point != here || ++*passed != count) return;
    std::fprintf(stderr, "test hook: killed at %s, passed %d times\n", here, count);
    ::raise(SIGKILL);
    ::pause();
  };
}

}  // namespace woodcock::coordinator
