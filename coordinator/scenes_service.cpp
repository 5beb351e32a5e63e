#include "coordinator/services.h"
#include "rpc/status.h"

namespace woodcock::coordinator {
namespace {

template <typename Work>
grpc::Status answer(Work work) {
  try {
    work();
    return grpc::Status::OK;
  } catch (const BlobError& error) {
    return {error.kind() == BlobError::Kind::NoSpace ? grpc::StatusCode::RESOURCE_EXHAUSTED : grpc::StatusCode::INTERNAL, error.what()};
  } catch (...) {
    return rpc::status_of_current_exception();
  }
}

}  // namespace

grpc::Status ScenesService::SubmitScene(grpc::ServerContext*, const v1::SubmitSceneRequest* request, v1::SubmitSceneResponse* response) {
  return answer([&] {
    const Admission::Ticket ticket(readers_, "scenes are read");
    *response = coordinator_.submit_scene(*request);
  });
}

grpc::Status ScenesService::GetPicture(grpc::ServerContext*, const v1::GetPictureRequest* request, v1::GetPictureResponse* response) {
  return answer([&] {
    const Admission::Ticket ticket(pictures_, "pictures are made");
    const auto [digest, bytes] = coordinator_.picture(request->job_id(), request->frame());
    response->set_content_digest(digest);
    response->set_bytes(bytes);
  });
}

}  // namespace woodcock::coordinator
