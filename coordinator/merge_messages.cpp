#include "coordinator/merge_messages.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <stdexcept>

namespace woodcock::coordinator {
namespace {

using Clock = std::chrono::steady_clock;
/// A million tiles with their paths.
constexpr uint64_t kMaxMessage = uint64_t{1} << 30;

[[noreturn]] void fail(const char* what) { throw std::runtime_error(std::string(what) + ": " + std::strerror(errno)); }

void write_all(int descriptor, const char* data, size_t size) {
  while (size > 0) {
    const ssize_t n = ::write(descriptor, data, size);
    if (n < 0 && errno != EINTR) fail("the process that merges cannot be told what");
    if (n <= 0) continue;
    data += n;
    size -= static_cast<size_t>(n);
  }
}

/// False at the end of what is sent.
bool read_all(int descriptor, char* data, size_t size, Clock::time_point deadline) {
  while (size > 0) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) throw std::runtime_error("the merge took too long");
    pollfd wait{descriptor, POLLIN, 0};
    const int ready = ::poll(&wait, 1, static_cast<int>(std::min<int64_t>(left, 1000)));
    if (ready < 0 && errno != EINTR) fail("waiting for the merge");
    if (ready <= 0) continue;
    const ssize_t n = ::read(descriptor, data, size);
    if (n == 0) return false;
    if (n < 0 && errno != EINTR) fail("reading what the merge says");
    if (n < 0) continue;
    data += n;
    size -= static_cast<size_t>(n);
  }
  return true;
}

}  // namespace

void send_message(int descriptor, const std::string& text) {
  const uint64_t size = text.size();
  std::string message(reinterpret_cast<const char*>(&size), sizeof size);
  message += text;
  write_all(descriptor, message.data(), message.size());
}

std::optional<std::string> receive_message(int descriptor, Clock::time_point deadline) {
  uint64_t size = 0;
  if (!read_all(descriptor, reinterpret_cast<char*>(&size), sizeof size, deadline)) return std::nullopt;
  if (size > kMaxMessage) throw std::runtime_error("the process that merges says nonsense");
  std::string text(size, '\0');
  if (!read_all(descriptor, text.data(), size, deadline)) return std::nullopt;
  return text;
}

std::optional<std::string> read_to_end(int descriptor, size_t limit, int watched) {
  std::string text;
  for (char buffer[4096]; text.size() <= limit;) {
    pollfd wait[2]{{descriptor, POLLIN, 0}, {watched, 0, 0}};
    if (::poll(wait, 2, -1) < 0) {
      if (errno == EINTR) continue;
      return std::nullopt;
    }
    if ((wait[1].revents & (POLLHUP | POLLERR)) != 0) return std::nullopt;
    if (wait[0].revents == 0) continue;
    const ssize_t n = ::read(descriptor, buffer, sizeof buffer);
    if (n == 0) return text;
    if (n < 0 && errno != EINTR) return std::nullopt;
    if (n > 0) text.append(buffer, static_cast<size_t>(n));
  }
  return std::nullopt;
}

}  // namespace woodcock::coordinator
