#include "rpc/error.h"

#include <exception>

namespace woodcock::rpc {

void fail_invalid(const std::string& message) { throw RpcError(Code::kInvalidArgument, message); }
void fail_not_found(const std::string& message) { throw RpcError(Code::kNotFound, message); }
void fail_precondition(const std::string& message) { throw RpcError(Code::kFailedPrecondition, message); }
void fail_exhausted(const std::string& message) { throw RpcError(Code::kResourceExhausted, message); }

const char* code_name(Code code) {
  switch (code) {
    case Code::kOk:
      return "OK";
    case Code::kCancelled:
      return "CANCELLED";
    case Code::kUnknown:
      return "UNKNOWN";
    case Code::kInvalidArgument:
      return "INVALID_ARGUMENT";
    case Code::kDeadlineExceeded:
      return "DEADLINE_EXCEEDED";
    case Code::kNotFound:
      return "NOT_FOUND";
    case Code::kAlreadyExists:
      return "ALREADY_EXISTS";
    case Code::kPermissionDenied:
      return "PERMISSION_DENIED";
    case Code::kResourceExhausted:
      return "RESOURCE_EXHAUSTED";
    case Code::kFailedPrecondition:
      return "FAILED_PRECONDITION";
    case Code::kAborted:
      return "ABORTED";
    case Code::kOutOfRange:
      return "OUT_OF_RANGE";
    case Code::kUnimplemented:
      return "UNIMPLEMENTED";
    case Code::kInternal:
      return "INTERNAL";
    case Code::kUnavailable:
      return "UNAVAILABLE";
    case Code::kDataLoss:
      return "DATA_LOSS";
    case Code::kUnauthenticated:
      return "UNAUTHENTICATED";
  }
  return "UNKNOWN";
}

bool is_retryable(Code code) {
  return code == Code::kUnavailable || code == Code::kDeadlineExceeded || code == Code::kResourceExhausted || code == Code::kAborted;
}

Outcome outcome_of_current_exception() {
  try {
    throw;
  } catch (const RpcError& error) {
    return {error.code(), error.what()};
  } catch (const std::invalid_argument& error) {
    return {Code::kInvalidArgument, error.what()};
  } catch (const std::exception& error) {
    return {Code::kInternal, error.what()};
  }
}

}  // namespace woodcock::rpc
