// The line between the supervisor and its render child.
#pragma once

#include <chrono>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "rpc/file_descriptor.h"

namespace woodcock {

/// One end of a SOCK_SEQPACKET pair. The kernel keeps message boundaries, so each packet is one JSON object and
/// a half-written message cannot be seen. Both directions may be used by different threads; one sender and one
/// receiver at a time.
class MessageChannel {
 public:
  /// A message that is larger than this is an error: commands and reports are small, results travel as files.
  static constexpr size_t kMaxMessage = 64 * 1024;

  MessageChannel() = default;
  explicit MessageChannel(rpc::FileDescriptor fd) : fd_(std::move(fd)) {}
  /// Two connected ends, both closed on exec.
  static std::pair<MessageChannel, MessageChannel> make_pair();

  /// False when the other end is gone, or takes nothing for `timeout`; zero never waits.
  bool send(const nlohmann::json& message, std::chrono::milliseconds timeout);

  enum class State { kMessage, kNothing, kClosed };
  /// Takes the next message that has arrived, without waiting. kClosed also for a packet that is no JSON:
  /// a peer that has lost its mind is treated as gone.
  State receive(nlohmann::json& message);

  int fd() const { return fd_.get(); }
  void close() { fd_.reset(); }

 private:
  rpc::FileDescriptor fd_;
};

}  // namespace woodcock
