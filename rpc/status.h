// Errors of calls on the wire: gRPC's status and ours, rpc/error.h.
#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "rpc/error.h"

namespace woodcock::rpc {

Code from_grpc(grpc::StatusCode code);
grpc::Status to_grpc(const Outcome& outcome);

/// Throws RpcError when `status` is not OK; the message begins with `what` ("submitting the job").
void throw_if_failed(const grpc::Status& status, const std::string& what);

/// Whether repeating the same call may help.
bool is_retryable(const grpc::Status& status);

/// The status of the exception being handled. Call it inside a catch block.
grpc::Status status_of_current_exception();

}  // namespace woodcock::rpc
