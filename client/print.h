// What commands say. Every text that is filled in is made safe to print: names of jobs, workers, scenes and files, and the messages of
// others, may hold escape sequences of a terminal (rpc/printable.h).
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <utility>

#include "rpc/printable.h"
#include "rpc/standard_output.h"

namespace woodcock {

/// A text of several lines that is filled in: its line ends stay.
struct Lines {
  std::string_view text;
};

/// A value as it is filled in: texts are printable lines, numbers as they are.
template <typename Value>
auto shown(const Value& value) {
  if constexpr (std::is_same_v<Value, Lines>)
    return rpc::printable_lines(value.text);
  else if constexpr (std::is_same_v<Value, std::filesystem::path>)
    return rpc::printable(value.native());
  else if constexpr (std::is_convertible_v<const Value&, std::string_view>)
    return rpc::printable(value);
  else
    return value;
}

/// To a stream, as fmt::print; what belongs to the format itself is printed as it is.
template <typename... Values>
void print_to(std::FILE* stream, fmt::format_string<decltype(shown(std::declval<const Values&>()))...> format, const Values&... values) {
  fmt::print(stream, format, shown(values)...);
}

/// To standard output, which holds results. What cannot be written there is found now, throwing std::runtime_error, or when the program
/// ends.
template <typename... Values>
void say(fmt::format_string<decltype(shown(std::declval<const Values&>()))...> format, const Values&... values) {
  try {
    print_to<Values...>(stdout, format, values...);
  } catch (const std::system_error& error) {
    rpc::fail_to_write_output(error.code().value());
  }
}

/// To standard error, which holds warnings and progress. Whether anyone reads them changes nothing.
template <typename... Values>
void note(fmt::format_string<decltype(shown(std::declval<const Values&>()))...> format, const Values&... values) {
  try {
    print_to<Values...>(stderr, format, values...);
  } catch (const std::system_error&) {
  }
}

/// Runs `print` and writes what it said. Where that cannot be written the error also tells `outcome`: what the command has made or changed
/// is so all the same. Throws std::runtime_error.
template <typename Print>
void say_outcome(const std::string& outcome, Print print) {
  try {
    print();
    rpc::flush_standard_output();
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}; {}", error.what(), outcome));
  }
}

/// JSON as text. Names that are not UTF-8 have U+FFFD where they are not: JSON cannot hold them.
inline std::string json_text(const nlohmann::json& json, int indent = 2) {
  return json.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

/// One object or list on standard output.
inline void say_json(const nlohmann::json& json, int indent = 2) { say("{}\n", Lines{json_text(json, indent)}); }

}  // namespace woodcock
