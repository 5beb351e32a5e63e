// What the coordinator and a merge server say to each other through pipes.
#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace woodcock::coordinator {

/// Begins the reply of a merge that gave no result; what follows says why.
inline constexpr const char* kCrashed = "crashed: ";

/// Writes the text with its length before it. Throws std::runtime_error where the other end has gone.
void send_message(int descriptor, const std::string& text);

/// Reads a text that was sent so. Nothing where the other end has gone; throws std::runtime_error where it is none, or the time is up.
std::optional<std::string> receive_message(int descriptor, std::chrono::steady_clock::time_point deadline);

/// Reads until the other end closes, at most `limit` bytes; nothing where it says more, or where `watched` has lost its other end.
std::optional<std::string> read_to_end(int descriptor, size_t limit, int watched);

}  // namespace woodcock::coordinator
