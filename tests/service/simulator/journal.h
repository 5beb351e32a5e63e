// What happened in a schedule, one line an event: written only where somebody reads it.
#pragma once

#include <fmt/format.h>

#include <ostream>
#include <string>
#include <utility>

#include "tests/service/simulator/loop.h"

namespace woodcock::simulator {

class Journal {
 public:
  Journal(const Loop& loop, std::ostream* out) : loop_(loop), out_(out) {}

  bool on() const { return out_ != nullptr; }
  /// `who`: "w1", "coordinator", "network".
  template <typename... Arguments>
  void say(const std::string& who, fmt::format_string<Arguments...> format, Arguments&&... arguments) {
    if (!out_) return;
    *out_ << fmt::format("{:10.4f} s  {:<12} ", static_cast<double>(loop_.now()) / static_cast<double>(kSecond) - 1000, who)
          << fmt::format(format, std::forward<Arguments>(arguments)...) << '\n';
  }

 private:
  const Loop& loop_;
  std::ostream* out_;
};

}  // namespace woodcock::simulator
