#include "coordinator/services.h"
#include "rpc/status.h"

namespace woodcock::coordinator {
namespace {

/// One held call. The coordinator finishes it, or the caller's going does; cancel_sync decides who.
class SyncCall final : public grpc::ServerUnaryReactor {
 public:
  SyncCall(Coordinator& coordinator, const v1::SyncRequest& request, v1::SyncResponse* response) : coordinator_(coordinator) {
    // The answer may come before sync() returns: then the token is set for nobody.
    const uint64_t token = coordinator_.sync(request, [this, response](const rpc::Outcome& outcome, const v1::SyncResponse& answer) {
      *response = answer;
      Finish(rpc::to_grpc(outcome));
    });
    token_ = token;
  }

  void OnCancel() override {
    if (const uint64_t token = token_; token != 0 && coordinator_.cancel_sync(token)) Finish(grpc::Status::CANCELLED);
  }
  void OnDone() override { delete this; }

 private:
  Coordinator& coordinator_;
  std::atomic<uint64_t> token_{0};
};

}  // namespace

grpc::ServerUnaryReactor* WorkersService::Sync(grpc::CallbackServerContext*, const v1::SyncRequest* request, v1::SyncResponse* response) {
  return new SyncCall(coordinator_, *request, response);
}

}  // namespace woodcock::coordinator
