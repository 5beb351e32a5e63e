#include "coordinator/listener.h"

#include <fcntl.h>
#include <netdb.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "rpc/address.h"

namespace woodcock::coordinator {
namespace {

constexpr rlim_t kMaxReserve = 256;
constexpr int kTickMs = 100;

[[noreturn]] void refuse(const std::string& listen, const std::string& why) {
  throw std::runtime_error("cannot listen on " + listen + ": " + why);
}

rlim_t descriptor_limit() {
  rlimit limit{};
  ::getrlimit(RLIMIT_NOFILE, &limit);
  return limit.rlim_cur;
}

/// Bound and listening; -1 with errno where it cannot be.
int listen_at(const addrinfo& at) {
  const int descriptor = ::socket(at.ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (descriptor < 0) return -1;
  const int on = 1, off = 0;
  // Connections of an earlier process that are still closing do not count; a second listener on the port does.
  ::setsockopt(descriptor, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  if (at.ai_family == AF_INET6) ::setsockopt(descriptor, IPPROTO_IPV6, IPV6_V6ONLY, &off, sizeof off);
  if (::bind(descriptor, at.ai_addr, at.ai_addrlen) == 0 && ::listen(descriptor, SOMAXCONN) == 0) return descriptor;
  const int error = errno;
  ::close(descriptor);
  errno = error;
  return -1;
}

int port_of(int descriptor) {
  sockaddr_storage address{};
  socklen_t size = sizeof address;
  ::getsockname(descriptor, reinterpret_cast<sockaddr*>(&address), &size);
  const auto* any = reinterpret_cast<const sockaddr*>(&address);
  return ntohs(any->sa_family == AF_INET6 ? reinterpret_cast<const sockaddr_in6*>(any)->sin6_port
                                          : reinterpret_cast<const sockaddr_in*>(any)->sin_port);
}

}  // namespace

rlim_t raise_descriptor_limit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur < limit.rlim_max) {
    limit.rlim_cur = limit.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &limit);
  }
  return descriptor_limit();
}

Listener::Listener(const std::string& listen) {
  const std::optional<rpc::Address> asked = rpc::parse_address(listen);
  if (!asked) refuse(listen, rpc::problem_of_listen_address(listen));
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = AI_PASSIVE | AI_NUMERICSERV;
  addrinfo* found = nullptr;
  if (const int error =
          ::getaddrinfo(asked->host.empty() ? nullptr : asked->host.c_str(), std::to_string(asked->port).c_str(), &hints, &found);
      error != 0)
    refuse(listen, ::gai_strerror(error));
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(found, &::freeaddrinfo);
  int error = 0;
  for (const addrinfo* at = found; at != nullptr && descriptor_ < 0; at = at->ai_next) {
    descriptor_ = listen_at(*at);
    error = errno;
  }
  if (descriptor_ < 0) refuse(listen, std::string(std::strerror(error)) + "; give another --listen");
  address_ = listen.substr(0, listen.rfind(':')) + ":" + std::to_string(port_of(descriptor_));
}

Listener::~Listener() { stop(); }

void Listener::start(std::function<void(int)> take) {
  take_ = std::move(take);
  thread_ = std::thread([this] { run(); });
}

void Listener::stop() {
  stopping_ = true;
  if (thread_.joinable()) thread_.join();
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
}

/// The lowest number that is free tells how many are in use at least.
bool Listener::has_room() const {
  const rlim_t limit = descriptor_limit();
  const int lowest = ::fcntl(descriptor_, F_DUPFD_CLOEXEC, 0);
  if (lowest < 0) return false;
  ::close(lowest);
  return static_cast<rlim_t>(lowest) + std::min(kMaxReserve, limit / 4) < limit;
}

void Listener::run() {
  bool full = false;
  while (!stopping_) {
    if (has_room() == full) {
      full = !full;
      if (full)
        spdlog::warn("as many connections as the limit of {} open files allows: others wait; raise `ulimit -n`", descriptor_limit());
      else
        spdlog::info("there is room for connections again");
    }
    if (full) {
      std::this_thread::sleep_for(std::chrono::milliseconds(kTickMs));
      continue;
    }
    pollfd wait{descriptor_, POLLIN, 0};
    if (::poll(&wait, 1, kTickMs) <= 0) continue;
    const int connection = ::accept4(descriptor_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
    if (connection < 0) {
      // It went while it waited, or there are no descriptors or no memory just now.
      if (errno != EAGAIN && errno != ECONNABORTED && errno != EINTR) std::this_thread::sleep_for(std::chrono::milliseconds(kTickMs));
      continue;
    }
    const int on = 1;
    ::setsockopt(connection, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    take_(connection);
  }
}

}  // namespace woodcock::coordinator
