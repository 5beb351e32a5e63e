// Durations and sizes as people write them on a command line: "90d", "500G".
#pragma once

#include <cstdint>
#include <string>

namespace woodcock::rpc {

/// Seconds of "90d", "12h", "30min", "45s"; "0" is 0. Throws std::invalid_argument with a sentence that begins with `name`.
int64_t parse_seconds(const std::string& name, const std::string& text);

/// Bytes of "500G", "20M", "1T", "4096": K, M, G and T are powers of 1024. Throws std::invalid_argument likewise.
int64_t parse_bytes(const std::string& name, const std::string& text);

/// "3 d", "12 h", "90 s": in the largest unit that divides it.
std::string duration_text(int64_t seconds);
/// "1.5 GiB".
std::string bytes_text(int64_t bytes);

}  // namespace woodcock::rpc
