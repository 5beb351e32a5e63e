#include "rpc/address.h"

#include <charconv>

#include "rpc/printable.h"

namespace woodcock::rpc {
namespace {

std::string found(const std::string& text, const std::string& expected) {
  return "found \"" + printable(text) + "\", expected " + expected;
}

}  // namespace

std::optional<Address> parse_address(std::string_view text) {
  const size_t colon = text.rfind(':');
  if (colon == std::string_view::npos) return std::nullopt;
  std::string_view host = text.substr(0, colon);
  const std::string_view digits = text.substr(colon + 1);
  Address address;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), address.port);
  if (error != std::errc() || end != digits.data() + digits.size() || digits[0] == '-' || address.port > 65535) return std::nullopt;
  if (host.size() > 2 && host.front() == '[' && host.back() == ']')
    host = host.substr(1, host.size() - 2);
  else if (host.find_first_of(":[]") != std::string_view::npos)
    return std::nullopt;
  if (host.find_first_of("/ \t\n") != std::string_view::npos) return std::nullopt;
  address.host = host;
  return address;
}

std::string problem_of_address(const std::string& text) {
  const auto address = parse_address(text);
  if (address && !address->host.empty() && address->port > 0) return {};
  return found(text, "HOST:PORT of a coordinator, e.g. 127.0.0.1:7420 or [::1]:7420");
}

std::string problem_of_listen_address(const std::string& text) {
  if (parse_address(text)) return {};
  return found(text, "HOST:PORT with a port from 0 to 65535, e.g. 127.0.0.1:7420, [::1]:7420, or 127.0.0.1:0 for any free port");
}

}  // namespace woodcock::rpc
