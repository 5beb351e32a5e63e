#include "rpc/quantities.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <limits>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

namespace woodcock::rpc {
namespace {

using Unit = std::pair<std::string_view, int64_t>;

constexpr std::array<Unit, 4> kDurations{{{"d", 86400}, {"h", 3600}, {"min", 60}, {"s", 1}}};
constexpr std::array<Unit, 5> kSizes{{{"T", int64_t{1} << 40}, {"G", int64_t{1} << 30}, {"M", 1 << 20}, {"K", 1 << 10}, {"", 1}}};

int64_t parse(const std::string& name, const std::string& text, std::span<const Unit> units, const char* expected) {
  int64_t number = 0;
  const char* const end = text.data() + text.size();
  const auto [p, error] = std::from_chars(text.data(), end, number);
  const std::string_view rest(p, static_cast<size_t>(end - p));
  if (error == std::errc() && number == 0 && rest.empty()) return 0;
  if (error == std::errc() && number > 0) {
    for (const auto& [unit, factor] : units)
      if (rest == unit && number <= std::numeric_limits<int64_t>::max() / factor) return number * factor;
  }
  throw std::invalid_argument(name + ": expected " + expected + ", found \"" + text + "\"");
}

}  // namespace

int64_t parse_seconds(const std::string& name, const std::string& text) {
  return parse(name, text, kDurations, "a duration such as 90d, 12h, 30min or 45s, or 0 for no limit");
}

int64_t parse_bytes(const std::string& name, const std::string& text) {
  return parse(name, text, kSizes, "a size such as 500G, 20M or 4096, or 0 for no limit");
}

std::string duration_text(int64_t seconds) {
  for (const auto& [unit, factor] : kDurations)
    if (seconds % factor == 0 && seconds >= factor) return fmt::format("{} {}", seconds / factor, unit);
  return fmt::format("{} s", seconds);
}

std::string bytes_text(int64_t bytes) {
  for (const auto& [unit, factor] : kSizes)
    if (bytes >= factor && !unit.empty()) return fmt::format("{:.1f} {}iB", static_cast<double>(bytes) / static_cast<double>(factor), unit);
  return fmt::format("{} bytes", bytes);
}

}  // namespace woodcock::rpc
