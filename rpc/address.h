// HOST:PORT, as people write where a coordinator is.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace woodcock::rpc {

struct Address {
  std::string host;  ///< a name or a number, IPv6 without its brackets; empty: every address of this machine
  int port = 0;
};

/// "farm:7420", "127.0.0.1:7420", "[::1]:7420", ":7420". Nothing where there is no port from 0 to 65535, or IPv6 has no brackets:
/// gRPC would take another port in silence.
std::optional<Address> parse_address(std::string_view text);

/// What to say of text that is no address of a coordinator to call, and of one to listen at; empty where it is one.
std::string problem_of_address(const std::string& text);
std::string problem_of_listen_address(const std::string& text);

}  // namespace woodcock::rpc
