// The coordinator's server: services, health, reflection, one port.
#pragma once

#include <memory>
#include <string>

#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>

#include "coordinator/listener.h"
#include "coordinator/services.h"

namespace woodcock::coordinator {

class CoordinatorServer {
 public:
  /// Listens on "HOST:PORT" (port 0: any). Throws std::runtime_error when it cannot.
  CoordinatorServer(Coordinator& coordinator, const std::string& listen);
  ~CoordinatorServer();

  /// "HOST:PORT" with the real port.
  const std::string& address() const { return listener_.address(); }
  /// Lets calls end for at most two seconds.
  void stop();

 private:
  Coordinator& coordinator_;
  JobsService jobs_;
  BlobsService blobs_;
  ScenesService scenes_;
  WorkersService workers_;
  Listener listener_;
  std::unique_ptr<grpc::experimental::ExternalConnectionAcceptor> acceptor_;
  std::unique_ptr<grpc::Server> server_;
};

}  // namespace woodcock::coordinator
