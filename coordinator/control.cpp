#include "coordinator/control.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include <spdlog/spdlog.h>
#include <nlohmann/json.hpp>

#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "rpc/failure.h"
#include "rpc/file_descriptor.h"

namespace woodcock::coordinator {
namespace {

constexpr size_t kMaxLine = 64 << 10;
constexpr time_t kRequestSeconds = 10;

[[noreturn]] void fail(const std::string& what, int error) { throw std::runtime_error(what + ": " + std::strerror(error)); }

/// A socket's address has room for 107 bytes: the folder is named by its descriptor.
sockaddr_un address_in(int folder) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  const std::string path = "/proc/self/fd/" + std::to_string(folder) + "/control";
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  return address;
}

const sockaddr* generic(const sockaddr_un& address) { return static_cast<const sockaddr*>(static_cast<const void*>(&address)); }

void send_line(int fd, const std::string& text) {
  const std::string line = text + "\n";
  for (size_t done = 0; done < line.size();) {
    const ssize_t n = ::send(fd, line.data() + done, line.size() - done, MSG_NOSIGNAL);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) fail("sending", errno);
    done += static_cast<size_t>(n);
  }
}

/// Throws where the peer goes, or says nothing for longer than the socket's time.
std::string receive_line(int fd) {
  std::string line;
  for (char c = 0; line.size() < kMaxLine;) {
    const ssize_t n = ::recv(fd, &c, 1, 0);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail("receiving", errno);
    if (n == 0) throw std::runtime_error("the connection ended");
    if (c == '\n') return line;
    line += c;
  }
  throw std::runtime_error("a line of more than 64 KiB");
}

}  // namespace

ControlSocket::ControlSocket(const std::string& dir, BackUp back_up) : path_(dir + "/control"), back_up_(std::move(back_up)) {
  const rpc::FileDescriptor folder{::open(dir.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC)};
  if (folder.get() < 0) fail("opening " + dir, errno);
  rpc::FileDescriptor listen{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  if (listen.get() < 0) fail("making a socket", errno);
  ::unlink(path_.c_str());
  const sockaddr_un address = address_in(folder.get());
  // The file gets the socket's mode: for its owner alone.
  if (::fchmod(listen.get(), 0600) != 0 || ::bind(listen.get(), generic(address), sizeof address) != 0 || ::listen(listen.get(), 8) != 0)
    fail("making the socket " + path_, errno);
  stop_ = ::eventfd(0, EFD_CLOEXEC);
  if (stop_ < 0) fail("making an event", errno);
  listen_ = listen.release();
  thread_ = std::thread([this] { run(); });
}

ControlSocket::~ControlSocket() {
  ::eventfd_write(stop_, 1);
  thread_.join();
  ::close(listen_);
  ::close(stop_);
  ::unlink(path_.c_str());
}

void ControlSocket::run() {
  for (;;) {
    pollfd wait[2] = {{listen_, POLLIN, 0}, {stop_, POLLIN, 0}};
    if (::poll(wait, 2, -1) < 0 && errno != EINTR) return;
    if (wait[1].revents != 0) return;
    if (wait[0].revents == 0) continue;
    const rpc::FileDescriptor connection{::accept4(listen_, nullptr, nullptr, SOCK_CLOEXEC)};
    if (connection.get() < 0) continue;
    if (const auto error = rpc::failure_of([&] { serve(connection.get()); }))
      spdlog::warn("a caller at {} was not served: {}", path_, *error);
  }
}

void ControlSocket::serve(int connection) const {
  const timeval patience{kRequestSeconds, 0};
  ::setsockopt(connection, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  ::setsockopt(connection, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  nlohmann::json answer;
  try {
    const nlohmann::json request = nlohmann::json::parse(receive_line(connection));
    const auto target = request.at("backup").get<std::string>();
    spdlog::info("a back-up to {} begins", target);
    const BackupRecord record = back_up_(target);
    spdlog::info("the back-up {} is complete: {} files, {} bytes", target, record.blobs, record.bytes);
    answer["record"] = to_json(record);
  } catch (const std::exception& error) {
    spdlog::warn("no back-up was made: {}", error.what());
    answer["error"] = error.what();
  }
  send_line(connection, answer.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

std::optional<BackupRecord> ask_for_backup(const std::string& dir, const std::string& target) {
  const rpc::FileDescriptor folder{::open(dir.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC)};
  if (folder.get() < 0) fail("the folder " + dir + " cannot be opened", errno);
  const rpc::FileDescriptor socket{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  if (socket.get() < 0) fail("making a socket", errno);
  const sockaddr_un address = address_in(folder.get());
  if (::connect(socket.get(), generic(address), sizeof address) != 0) {
    if (errno == ENOENT || errno == ECONNREFUSED || errno == ENOTSOCK) return std::nullopt;
    fail("the socket " + dir + "/control", errno);
  }
  send_line(socket.get(), nlohmann::json{{"backup", target}}.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  std::string line;
  try {
    // However long it takes: it ends with the coordinator.
    line = receive_line(socket.get());
  } catch (const std::exception& error) {
    throw std::runtime_error(std::string("the coordinator ended before the back-up was complete: ") + error.what());
  }
  try {
    const nlohmann::json answer = nlohmann::json::parse(line);
    if (answer.contains("error")) throw std::runtime_error(answer.at("error").get<std::string>());
    return backup_record_from_json(answer.at("record").get<std::string>());
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(std::string("the coordinator answers nonsense: ") + error.what());
  }
}

}  // namespace woodcock::coordinator
