// The gRPC services: they check what comes in, call the coordinator, and map errors. Workers are served by callbacks, without a
// thread each; jobs and blobs by a bounded pool of threads.
#pragma once

#include <atomic>

#include "coordinator/coordinator.h"
#include "coordinator/stream_places.h"
#include "coordinator/watchers.h"
#include "woodcock/v1/blobs_service.grpc.pb.h"
#include "woodcock/v1/jobs_service.grpc.pb.h"
#include "woodcock/v1/scenes_service.grpc.pb.h"
#include "woodcock/v1/workers_service.grpc.pb.h"

namespace woodcock::coordinator {

/// At most `limit` at a time: the others are told RESOURCE_EXHAUSTED.
class Admission {
 public:
  explicit Admission(int limit) : free_(limit) {}
  class Ticket {
   public:
    explicit Ticket(Admission& admission, const char* what);
    ~Ticket() { ++admission_.free_; }
    Ticket(const Ticket&) = delete;
    Ticket& operator=(const Ticket&) = delete;

   private:
    Admission& admission_;
  };

 private:
  std::atomic<int> free_;
};

class JobsService final : public v1::JobsService::WithCallbackMethod_WatchJob<v1::JobsService::Service> {
 public:
  explicit JobsService(Coordinator& coordinator) : coordinator_(coordinator), watchers_(coordinator) {}
  /// Lets watchers go; the server can stop then.
  void stop() { watchers_.stop(); }

  grpc::Status SubmitJob(grpc::ServerContext*, const v1::SubmitJobRequest*, v1::SubmitJobResponse*) override;
  grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest*, v1::GetJobResponse*) override;
  grpc::Status ListJobs(grpc::ServerContext*, const v1::ListJobsRequest*, v1::ListJobsResponse*) override;
  using WithCallbackMethod_WatchJob::WatchJob;
  grpc::ServerWriteReactor<v1::WatchJobResponse>* WatchJob(grpc::CallbackServerContext*, const v1::WatchJobRequest*) override;
  grpc::Status CancelJob(grpc::ServerContext*, const v1::CancelJobRequest*, v1::CancelJobResponse*) override;
  grpc::Status PauseJob(grpc::ServerContext*, const v1::PauseJobRequest*, v1::PauseJobResponse*) override;
  grpc::Status ResumeJob(grpc::ServerContext*, const v1::ResumeJobRequest*, v1::ResumeJobResponse*) override;
  grpc::Status GetFrame(grpc::ServerContext*, const v1::GetFrameRequest*, v1::GetFrameResponse*) override;
  grpc::Status GetTaskLog(grpc::ServerContext*, const v1::GetTaskLogRequest*, v1::GetTaskLogResponse*) override;
  grpc::Status ExtendJob(grpc::ServerContext*, const v1::ExtendJobRequest*, v1::ExtendJobResponse*) override;
  grpc::Status RepinJob(grpc::ServerContext*, const v1::RepinJobRequest*, v1::RepinJobResponse*) override;
  grpc::Status ListResults(grpc::ServerContext*, const v1::ListResultsRequest*, v1::ListResultsResponse*) override;
  grpc::Status ListWorkers(grpc::ServerContext*, const v1::ListWorkersRequest*, v1::ListWorkersResponse*) override;
  grpc::Status DeleteJob(grpc::ServerContext*, const v1::DeleteJobRequest*, v1::DeleteJobResponse*) override;
  grpc::Status ListEvents(grpc::ServerContext*, const v1::ListEventsRequest*, v1::ListEventsResponse*) override;
  grpc::Status RetainJobs(grpc::ServerContext*, const v1::RetainJobsRequest*, v1::RetainJobsResponse*) override;

 private:
  Coordinator& coordinator_;
  Watchers watchers_;
  Admission merges_{2}, retentions_{2};
};

class BlobsService final : public v1::BlobsService::Service {
 public:
  explicit BlobsService(Coordinator& coordinator, const StreamPlacesOptions& places = {});
  grpc::Status FindMissing(grpc::ServerContext*, const v1::FindMissingRequest*, v1::FindMissingResponse*) override;
  grpc::Status QueryUpload(grpc::ServerContext*, const v1::QueryUploadRequest*, v1::QueryUploadResponse*) override;
  grpc::Status Upload(grpc::ServerContext*, grpc::ServerReader<v1::UploadRequest>*, v1::UploadResponse*) override;
  grpc::Status Download(grpc::ServerContext*, const v1::DownloadRequest*, grpc::ServerWriter<v1::DownloadResponse>*) override;

 private:
  /// May wait for who sends the same blob and does not move.
  std::unique_ptr<BlobStore::Upload> begin_upload(const v1::UploadHeader& header);

  Coordinator& coordinator_;
  StreamPlaces uploads_, downloads_;
};

class ScenesService final : public v1::ScenesService::Service {
 public:
  explicit ScenesService(Coordinator& coordinator) : coordinator_(coordinator) {}
  grpc::Status SubmitScene(grpc::ServerContext*, const v1::SubmitSceneRequest*, v1::SubmitSceneResponse*) override;
  grpc::Status GetPicture(grpc::ServerContext*, const v1::GetPictureRequest*, v1::GetPictureResponse*) override;

 private:
  Coordinator& coordinator_;
  Admission readers_{4}, pictures_{4};
};

class WorkersService final : public v1::WorkersService::CallbackService {
 public:
  explicit WorkersService(Coordinator& coordinator) : coordinator_(coordinator) {}
  grpc::ServerUnaryReactor* Sync(grpc::CallbackServerContext*, const v1::SyncRequest*, v1::SyncResponse*) override;

 private:
  Coordinator& coordinator_;
};

}  // namespace woodcock::coordinator
