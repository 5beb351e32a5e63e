// F29: a stream that is silent for long notices that its peer has gone. The network is cut by a proxy that stops to forward.
#include <arpa/inet.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <vector>

#include "rpc/channel.h"
#include "woodcock/v1/jobs_service.grpc.pb.h"

namespace woodcock::rpc {
namespace {

using std::chrono::milliseconds;

sockaddr_in loopback(int port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(static_cast<uint16_t>(port));
  return address;
}

/// Carries connections to a port of this machine, until it is cut: then it keeps them open and carries nothing.
class Proxy {
 public:
  explicit Proxy(int target) : target_(target), listener_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in address = loopback(0);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(listener_, reinterpret_cast<sockaddr*>(&address), size), 0);
    EXPECT_EQ(::listen(listener_, 16), 0);
    EXPECT_EQ(::getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { run(); });
  }
  ~Proxy() {
    stop_ = true;
    thread_.join();
    ::close(listener_);
    for (const auto& [client, server] : lines_) ::close(client), ::close(server);
  }
  std::string address() const { return "127.0.0.1:" + std::to_string(port_); }
  void cut() { cut_ = true; }
  /// How often the client has sent something.
  int from_client() const { return from_client_; }

 private:
  void run() {
    while (!stop_) {
      std::vector<pollfd> waits{{listener_, POLLIN, 0}};
      if (!cut_)
        for (const auto& [client, server] : lines_) waits.push_back({client, POLLIN, 0}), waits.push_back({server, POLLIN, 0});
      ::poll(waits.data(), waits.size(), 20);
      if (cut_) continue;
      for (size_t i = 1; i < waits.size(); ++i)
        if ((waits[i].revents & POLLIN) != 0) carry(waits[i].fd, waits[((i - 1) ^ 1) + 1].fd, i % 2 == 1);
      if ((waits[0].revents & POLLIN) == 0) continue;
      const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC), server = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
      const sockaddr_in to = loopback(target_);
      EXPECT_EQ(::connect(server, reinterpret_cast<const sockaddr*>(&to), sizeof to), 0);
      lines_.emplace_back(client, server);
    }
  }
  void carry(int from, int to, bool is_client) {
    char bytes[4096];
    const ssize_t n = ::recv(from, bytes, sizeof bytes, MSG_DONTWAIT);
    if (n <= 0) return;
    from_client_ += is_client;
    ::send(to, bytes, static_cast<size_t>(n), MSG_NOSIGNAL);
  }

  const int target_, listener_;
  int port_ = 0;
  std::atomic<bool> stop_{false}, cut_{false};
  std::atomic<int> from_client_{0};
  std::vector<std::pair<int, int>> lines_;
  std::thread thread_;
};

/// Says one thing, and then nothing for ever.
class SilentJobs final : public v1::JobsService::Service {
  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest*,
                        grpc::ServerWriter<v1::WatchJobResponse>* writer) override {
    writer->Write(v1::WatchJobResponse());
    while (!context->IsCancelled()) std::this_thread::sleep_for(milliseconds(20));
    return grpc::Status::CANCELLED;
  }
};

TEST(KeepAlive, F29ASilentStreamGoesOnPingingAndNoticesACut) {
  SilentJobs jobs;
  grpc::ServerBuilder builder;
  int port = 0;
  builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 10);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PING_STRIKES, 0);
  builder.RegisterService(&jobs);
  const std::unique_ptr<grpc::Server> server = builder.BuildAndStart();
  {
    Proxy proxy(port);
    const auto channel = make_channel(proxy.address(), {milliseconds(200), milliseconds(1500)});
    const auto stub = v1::JobsService::NewStub(channel);
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(60));
    const auto reader = stub->WatchJob(&context, v1::WatchJobRequest());
    v1::WatchJobResponse response;
    ASSERT_TRUE(reader->Read(&response));
    // A peer that gave up after two pings would fall silent here.
    const int begin = proxy.from_client();
    const auto patience = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    while (proxy.from_client() < begin + 8 && std::chrono::steady_clock::now() < patience) std::this_thread::sleep_for(milliseconds(10));
    ASSERT_GE(proxy.from_client(), begin + 8) << "pings end in silence";
    proxy.cut();
    EXPECT_FALSE(reader->Read(&response));
    EXPECT_EQ(reader->Finish().error_code(), grpc::StatusCode::UNAVAILABLE);
  }
  server->Shutdown(std::chrono::system_clock::now());
}

}  // namespace
}  // namespace woodcock::rpc
