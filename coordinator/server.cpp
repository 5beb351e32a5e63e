#include "coordinator/server.h"

#include <grpcpp/ext/proto_server_reflection_plugin.h>
#include <grpcpp/health_check_service_interface.h>
#include <grpcpp/resource_quota.h>
#include <grpcpp/security/server_credentials.h>
#include <grpcpp/server_builder.h>

#include <chrono>
#include <stdexcept>

#include "coordinator/malformed_requests.h"
#include "rpc/limits.h"

namespace woodcock::coordinator {

CoordinatorServer::CoordinatorServer(Coordinator& coordinator, const std::string& listen)
    : coordinator_(coordinator), jobs_(coordinator), blobs_(coordinator), scenes_(coordinator), workers_(coordinator), listener_(listen) {
  grpc::EnableDefaultHealthCheckService(true);
  grpc::reflection::InitProtoReflectionServerBuilderPlugin();
  grpc::ServerBuilder builder;
  acceptor_ = builder.experimental().AddExternalConnectionAcceptor(grpc::ServerBuilder::experimental_type::ExternalConnectionType::FROM_FD,
                                                                   grpc::InsecureServerCredentials());
  builder.RegisterService(&jobs_);
  builder.RegisterService(&blobs_);
  builder.RegisterService(&scenes_);
  builder.RegisterService(&workers_);
  builder.SetMaxReceiveMessageSize(rpc::kMaxMessageBytes);
  builder.SetMaxSendMessageSize(rpc::kMaxMessageBytes);
  // Who connects and says nothing, or has had no call for long, makes room for others.
  builder.AddChannelArgument(GRPC_ARG_SERVER_HANDSHAKE_TIMEOUT_MS, 20'000);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONNECTION_IDLE_MS, 300'000);
  builder.AddChannelArgument(GRPC_ARG_MAX_CONCURRENT_STREAMS, 256);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIME_MS, 20'000);
  builder.AddChannelArgument(GRPC_ARG_KEEPALIVE_TIMEOUT_MS, 10'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MIN_RECV_PING_INTERVAL_WITHOUT_DATA_MS, 5'000);
  builder.AddChannelArgument(GRPC_ARG_HTTP2_MAX_PINGS_WITHOUT_DATA, 0);
  grpc::ResourceQuota quota("coordinator");
  quota.Resize(size_t{1} << 30);
  quota.SetMaxThreads(256);
  builder.SetResourceQuota(quota);
  explain_malformed_requests(builder);
  server_ = builder.BuildAndStart();
  if (!server_) throw std::runtime_error("gRPC cannot serve on " + listen);
  listener_.start([this](int descriptor) {
    grpc::experimental::ExternalConnectionAcceptor::NewConnectionParameters connection;
    connection.fd = descriptor;
    acceptor_->HandleNewConnection(&connection);
  });
  coordinator_.set_address(address());
}

CoordinatorServer::~CoordinatorServer() { stop(); }

void CoordinatorServer::stop() {
  if (!server_) return;
  listener_.stop();
  jobs_.stop();
  coordinator_.stop_syncs();
  server_->Shutdown(std::chrono::system_clock::now() + std::chrono::seconds(2));
  server_->Wait();
  server_.reset();
}

}  // namespace woodcock::coordinator
