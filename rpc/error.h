// Errors of calls, as everything but rpc and the services sees them.
#pragma once

#include <stdexcept>
#include <string>

namespace woodcock::rpc {

/// The canonical codes of gRPC, by their numbers on the wire.
enum class Code {
  kOk = 0,
  kCancelled = 1,
  kUnknown = 2,
  kInvalidArgument = 3,
  kDeadlineExceeded = 4,
  kNotFound = 5,
  kAlreadyExists = 6,
  kPermissionDenied = 7,
  kResourceExhausted = 8,
  kFailedPrecondition = 9,
  kAborted = 10,
  kOutOfRange = 11,
  kUnimplemented = 12,
  kInternal = 13,
  kUnavailable = 14,
  kDataLoss = 15,
  kUnauthenticated = 16,
};

/// How a call ended: a code, and unless it is kOk a sentence that says what is wrong and what to do.
struct Outcome {
  Code code = Code::kOk;
  std::string message;
  bool ok() const { return code == Code::kOk; }
};

/// A call that failed, or must fail. The message is a sentence that says what is wrong and what to do.
class RpcError : public std::runtime_error {
 public:
  RpcError(Code code, const std::string& message) : std::runtime_error(message), code_(code) {}
  Code code() const { return code_; }

 private:
  Code code_;
};

[[noreturn]] void fail_invalid(const std::string& message);       ///< kInvalidArgument
[[noreturn]] void fail_not_found(const std::string& message);     ///< kNotFound
[[noreturn]] void fail_precondition(const std::string& message);  ///< kFailedPrecondition
[[noreturn]] void fail_exhausted(const std::string& message);     ///< kResourceExhausted

/// The canonical name, e.g. "NOT_FOUND".
const char* code_name(Code code);

/// Whether repeating the same call may help: unavailable, deadline exceeded, resource exhausted, aborted.
bool is_retryable(Code code);

/// What the exception being handled says of a call: RpcError as it is, std::invalid_argument as kInvalidArgument, anything else
/// kInternal. Call it inside a catch block.
Outcome outcome_of_current_exception();

}  // namespace woodcock::rpc
