// Amounts of memory, as people write and read them.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace woodcock::rpc {

/// "512M", "8G", "1.5T", also with B or iB behind; the units are powers of 1024, a number alone counts bytes. Throws
/// std::invalid_argument that says what was found and what is expected: an amount above 0, below 2^60 bytes.
int64_t parse_memory(std::string_view text);

/// "8 GiB", "1.5 GiB", "300 B".
std::string memory_text(int64_t bytes);

}  // namespace woodcock::rpc
