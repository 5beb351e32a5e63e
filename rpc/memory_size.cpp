#include "rpc/memory_size.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

#include "rpc/printable.h"

namespace woodcock::rpc {
namespace {

constexpr std::string_view kUnits = "KMGT";

}  // namespace

int64_t parse_memory(std::string_view text) {
  const auto refuse = [&]() -> int64_t {
    throw std::invalid_argument("found \"" + printable(std::string(text.substr(0, 40))) +
                                "\", expected an amount of memory above 0, e.g. 512M, 8G or 1.5T");
  };
  // Digits and one point: nothing that depends on a locale, no exponents, no signs.
  double value = 0, place = 0;
  size_t digits = 0, at = 0;
  for (; at < text.size() && ((text[at] >= '0' && text[at] <= '9') || (text[at] == '.' && place == 0)); ++at) {
    if (text[at] == '.') {
      place = 1;
      continue;
    }
    ++digits;
    if (place > 0)
      value += (text[at] - '0') * (place /= 10);
    else
      value = 10 * value + (text[at] - '0');
  }
  std::string_view unit = text.substr(at);
  double factor = 1;
  if (!unit.empty()) {
    const size_t power = kUnits.find(static_cast<char>(unit[0] & ~0x20));
    if (power != std::string_view::npos) {
      factor = std::ldexp(1.0, 10 * (static_cast<int>(power) + 1));
      unit.remove_prefix(1);
      if (unit == "iB" || unit == "ib") unit = {};
    }
    if (unit == "B" || unit == "b") unit = {};
  }
  const double bytes = value * factor;
  if (digits == 0 || !unit.empty() || !(bytes >= 1) || bytes >= 0x1p60) return refuse();
  return static_cast<int64_t>(bytes);
}

std::string memory_text(int64_t bytes) {
  double value = static_cast<double>(bytes);
  std::string unit = "B";
  for (const char prefix : kUnits) {
    if (value < 1024) break;
    value /= 1024;
    unit = std::string(1, prefix) + "iB";
  }
  return fmt::format("{:.4g} {}", value, unit);
}

}  // namespace woodcock::rpc
