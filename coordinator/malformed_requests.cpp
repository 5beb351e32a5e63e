#include "coordinator/malformed_requests.h"

#include <google/protobuf/stubs/logging.h>
#include <grpcpp/support/server_interceptor.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace woodcock::coordinator {
namespace {

/// The field of which protobuf said last that it is not UTF-8, on this thread: a request is parsed on the thread that answers it.
thread_local std::string malformed_field;

void hear_protobuf(google::protobuf::LogLevel level, const char*, int, const std::string& message) {
  // "String field 'woodcock.v1.SubmitJobRequest.name' contains invalid UTF-8 data when parsing a protocol buffer. …"
  const size_t begin = message.find('\''), end = message.find('\'', begin + 1);
  if (message.find("invalid UTF-8") != std::string::npos && end != std::string::npos) {
    const std::string field = message.substr(begin + 1, end - begin - 1);
    malformed_field = field.substr(field.find_last_of('.', field.find_last_of('.') - 1) + 1);
  } else if (level >= google::protobuf::LOGLEVEL_WARNING) {
    spdlog::warn("protobuf: {}", message);
  }
}

class Explain final : public grpc::experimental::Interceptor {
 public:
  void Intercept(grpc::experimental::InterceptorBatchMethods* call) override {
    if (call->QueryInterceptionHookPoint(grpc::experimental::InterceptionHookPoints::PRE_SEND_STATUS)) {
      const grpc::Status status = call->GetSendStatus();
      const std::string field = std::exchange(malformed_field, {});
      // Our own services always say why.
      const bool unparsed = status.error_message().empty() && (status.error_code() == grpc::StatusCode::INTERNAL ||
                                                               (status.error_code() == grpc::StatusCode::UNIMPLEMENTED && !field.empty()));
      if (unparsed)
        call->ModifySendStatus({grpc::StatusCode::INVALID_ARGUMENT,
                                field.empty() ? "the request is not the message that this call takes" : field + ": expected UTF-8"});
    }
    call->Proceed();
  }
};

class ExplainEach final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo*) override { return new Explain; }
};

}  // namespace

void explain_malformed_requests(grpc::ServerBuilder& builder) {
  google::protobuf::SetLogHandler(hear_protobuf);
  std::vector<std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface>> creators;
  creators.push_back(std::make_unique<ExplainEach>());
  builder.experimental().SetInterceptorCreators(std::move(creators));
}

}  // namespace woodcock::coordinator
