// Errors of calls: one exception on our side, grpc::Status on the wire.
#pragma once

#include <stdexcept>
#include <string>

#include <grpcpp/support/status.h>

namespace woodcock::rpc {

/// A call that failed, or must fail. The message is a sentence that says what is wrong and what to do.
class RpcError : public std::runtime_error {
 public:
  RpcError(grpc::StatusCode code, const std::string& message) : std::runtime_error(message), code_(code) {}
  grpc::StatusCode code() const { return code_; }

 private:
  grpc::StatusCode code_;
};

[[noreturn]] void fail_invalid(const std::string& message);       ///< INVALID_ARGUMENT
[[noreturn]] void fail_not_found(const std::string& message);     ///< NOT_FOUND
[[noreturn]] void fail_precondition(const std::string& message);  ///< FAILED_PRECONDITION
[[noreturn]] void fail_exhausted(const std::string& message);     ///< RESOURCE_EXHAUSTED

/// The canonical name, e.g. "NOT_FOUND".
const char* code_name(grpc::StatusCode code);

/// Throws RpcError when `status` is not OK; the message begins with `what` ("submitting the job").
void throw_if_failed(const grpc::Status& status, const std::string& what);

/// Whether repeating the same call may help: UNAVAILABLE, DEADLINE_EXCEEDED, RESOURCE_EXHAUSTED, ABORTED.
bool is_retryable(grpc::StatusCode code);

/// The status of the exception being handled: RpcError as it is, std::invalid_argument as INVALID_ARGUMENT, anything else
/// INTERNAL. Call it inside a catch block.
grpc::Status status_of_current_exception();

}  // namespace woodcock::rpc
