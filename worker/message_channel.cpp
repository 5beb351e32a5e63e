#include "worker/message_channel.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>

#include <cerrno>
#include <string>
#include <system_error>

namespace woodcock {

std::pair<MessageChannel, MessageChannel> MessageChannel::make_pair() {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0)
    throw std::system_error(errno, std::generic_category(), "cannot make a socket pair for the render child");
  return {MessageChannel(rpc::FileDescriptor(ends[0])), MessageChannel(rpc::FileDescriptor(ends[1]))};
}

bool MessageChannel::send(const nlohmann::json& message, std::chrono::milliseconds timeout) {
  if (!fd_) return false;
  const std::string text = message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
  if (text.size() > kMaxMessage) return false;
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  while (true) {
    const ssize_t sent = ::send(fd_.get(), text.data(), text.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent == static_cast<ssize_t>(text.size())) return true;
    if (sent < 0 && errno == EINTR) continue;
    if (sent >= 0 || (errno != EAGAIN && errno != EWOULDBLOCK)) return false;
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    if (left.count() <= 0) return false;
    pollfd wait{fd_.get(), POLLOUT, 0};
    ::poll(&wait, 1, static_cast<int>(left.count()));
  }
}

MessageChannel::State MessageChannel::receive(nlohmann::json& message) {
  if (!fd_) return State::kClosed;
  std::string text(kMaxMessage, '\0');
  while (true) {
    const ssize_t got = ::recv(fd_.get(), text.data(), text.size(), MSG_DONTWAIT);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0 && (errno == EAGAIN || errno == EWOULDBLOCK)) return State::kNothing;
    if (got <= 0) return State::kClosed;
    message = nlohmann::json::parse(text.begin(), text.begin() + got, nullptr, false);
    return message.is_object() ? State::kMessage : State::kClosed;
  }
}

}  // namespace woodcock
