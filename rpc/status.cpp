#include "rpc/status.h"

namespace woodcock::rpc {

static_assert(static_cast<int>(Code::kUnauthenticated) == grpc::StatusCode::UNAUTHENTICATED &&
              static_cast<int>(Code::kDataLoss) == grpc::StatusCode::DATA_LOSS);

Code from_grpc(grpc::StatusCode code) {
  return code >= grpc::StatusCode::OK && code <= grpc::StatusCode::UNAUTHENTICATED ? static_cast<Code>(static_cast<int>(code))
                                                                                   : Code::kUnknown;
}

grpc::Status to_grpc(const Outcome& outcome) {
  return outcome.ok() ? grpc::Status::OK : grpc::Status(static_cast<grpc::StatusCode>(static_cast<int>(outcome.code)), outcome.message);
}

void throw_if_failed(const grpc::Status& status, const std::string& what) {
  if (status.ok()) return;
  const Code code = from_grpc(status.error_code());
  throw RpcError(code, what + ": " + status.error_message() + " (" + code_name(code) + ")");
}

bool is_retryable(const grpc::Status& status) { return is_retryable(from_grpc(status.error_code())); }

grpc::Status status_of_current_exception() { return to_grpc(outcome_of_current_exception()); }

}  // namespace woodcock::rpc
