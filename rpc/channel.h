// Channels to a coordinator, and deadlines for every call.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include <grpcpp/channel.h>
#include <grpcpp/client_context.h>

namespace woodcock::rpc {

/// The address that programs use when none is given.
inline constexpr const char* kDefaultAddress = "127.0.0.1:7420";

/// A peer that answers no ping for `timeout` is dead; one is sent after `interval` without traffic.
struct KeepAlive {
  std::chrono::milliseconds interval{20'000}, timeout{10'000};
};

/// A channel to "HOST:PORT" with the message limits of rpc/limits.h, keep-alive and fast reconnection. Connects lazily:
/// an unreachable coordinator shows as UNAVAILABLE in the first call. Not encrypted: bind to loopback, or tunnel.
std::shared_ptr<grpc::Channel> make_channel(const std::string& address, KeepAlive keep_alive = {});

/// Every call has a deadline: this many milliseconds from now.
void set_deadline(grpc::ClientContext& context, std::chrono::milliseconds timeout);

/// The address a coordinator wrote into its folder (`DIR/address`) when it began to listen; empty if there is none.
std::string read_address_file(const std::string& coordinator_dir);

}  // namespace woodcock::rpc
