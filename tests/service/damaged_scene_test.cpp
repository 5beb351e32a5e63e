// F28: a scene that is damaged on the coordinator's disk, or in the cache of one worker.
#include <signal.h>

#include <map>
#include <string>

#include "rpc/channel.h"
#include "rpc/manifest.h"
#include "tests/service/farm_faults.h"
#include "woodcock/v1/blobs_service.grpc.pb.h"
#include "woodcock/v1/jobs_service.grpc.pb.h"
#include "woodcock/v1/scenes_service.grpc.pb.h"

namespace woodcock::testing_service {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

/// Writes over one letter of a word of the scene, in place: the file keeps its size, and its other names.
void damage(const fs::path& file) {
  const std::string text = contents(file);
  const size_t at = text.find("WorldBegin");
  ASSERT_NE(at, std::string::npos) << file;
  std::fstream(file, std::ios::in | std::ios::out | std::ios::binary).seekp(static_cast<std::streamoff>(at)).put('w');
}

class F28 : public FarmFault {
 protected:
  /// The scene file in a folder of blobs.
  fs::path scene_in(const fs::path& blobs) const {
    const std::string text = contents(cornell_);
    for (const auto& entry : fs::recursive_directory_iterator(blobs))
      if (entry.is_regular_file() && contents(entry.path()) == text) return entry.path();
    ADD_FAILURE() << "the scene is not in " << blobs;
    return {};
  }
  fs::path cache() const { return folder_ / "worker0" / "assets" / "blobs"; }
  /// A job that ends and leaves its scene in the worker's cache.
  void fill_cache() { ASSERT_EQ(watch(submit({cornell_, "--spp", "1", "--resolution", "16x16"})), 0); }
};

TEST_F(F28, F28_ASceneDamagedAtTheCoordinatorIsSaidAndHealedByANewSubmit) {
  start_coordinator();
  const std::string job = start_job();
  kill_coordinator();
  damage(scene_in(folder_ / "coordinator" / "blobs"));
  restart_coordinator();
  start_worker();
  std::string reason;
  ASSERT_TRUE(eventually(kPatience, [&] {
    return (reason = show(job)["frames"][0].value("waiting_reason", "")).find("damaged") != std::string::npos;
  })) << reason;
  EXPECT_THAT(reason, HasSubstr("cornell.pbrt"));
  EXPECT_THAT(reason, HasSubstr("submit the scene again"));
  const std::string again = start_job();
  expect_undisturbed(job);
  EXPECT_EQ(watch(again), 0);
}

TEST_F(F28, F28_ASceneDamagedInAWorkersCacheIsFetchedAgain) {
  start_coordinator();
  start_worker();
  fill_cache();
  damage(scene_in(cache()));
  expect_undisturbed(start_job());
  EXPECT_THAT(workers_.front()->err(), HasSubstr("damaged in this worker's cache"));
}

TEST_F(F28, F28_ACacheThatCannotBeReadAfterARestartIsFetchedAgain) {
  start_coordinator();
  start_worker();
  fill_cache();
  workers_.front()->signal(SIGKILL);
  workers_.front()->wait(kPatience);
  make_unreadable(scene_in(cache()), Unreadable::kFolder);
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "worker0" / "assets" / "scenes"))
    if (entry.path().filename() == "cornell.pbrt") make_unreadable(entry.path(), Unreadable::kIoError);
  restart_workers();
  expect_undisturbed(start_job());
  EXPECT_TRUE(workers_.front()->running());
}

/// Calls of the contract, as a program makes them that reads no scene.
class F28Contract : public F28 {
 protected:
  std::string upload(const std::string& content) {
    const auto stub = v1::BlobsService::NewStub(rpc::make_channel(address_));
    grpc::ClientContext context;
    rpc::set_deadline(context, kPatience);
    v1::UploadResponse response;
    const auto writer = stub->Upload(&context, &response);
    v1::UploadRequest request;
    request.mutable_header()->set_content_digest(rpc::blob_digest(content));
    request.mutable_header()->set_total_bytes(static_cast<int64_t>(content.size()));
    writer->Write(request);
    request.set_chunk(content);
    writer->Write(request);
    writer->WritesDone();
    const grpc::Status status = writer->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    return rpc::blob_digest(content);
  }
  /// The manifest of these files, uploaded with them.
  std::string upload_scene(const std::map<std::string, std::string>& files) {
    v1::SceneManifest manifest;
    for (const auto& [name, content] : files) {
      v1::SceneFile& file = *manifest.add_files();
      file.set_path(name);
      file.set_content_digest(upload(content));
      file.set_bytes(static_cast<int64_t>(content.size()));
    }
    return upload(rpc::serialize_manifest(manifest));
  }
};

TEST_F(F28Contract, F28_ASceneErrorOfAWorkerNamesFilesAsTheUserDoes) {
  start_coordinator();
  // The request of a scene without faults, with another scene in its place: the client would refuse that one.
  const std::string text = "Camera \"perspective\"\nWorldBegin\nLightSource \"infinite\"\n";
  v1::SubmitSceneRequest good;
  good.set_request_id("good");
  good.mutable_settings()->mutable_resolution()->set_width(8);
  good.mutable_settings()->mutable_resolution()->set_height(8);
  good.mutable_settings()->set_samples(1);
  good.add_files()->set_path("bad.pbrt");
  good.mutable_files(0)->set_content(text);
  v1::SubmitSceneResponse response;
  {
    grpc::ClientContext context;
    rpc::set_deadline(context, kPatience);
    const grpc::Status status = v1::ScenesService::NewStub(rpc::make_channel(address_))->SubmitScene(&context, good, &response);
    ASSERT_TRUE(status.ok()) << status.error_message();
  }
  v1::SubmitJobRequest request = response.resolved();
  request.set_request_id("bad");
  request.mutable_frames(0)->set_manifest_digest(
      upload_scene({{"bad.pbrt", text + "Shape \"plymesh\" \"string filename\" \"meshes/bad.ply\"\n"}, {"meshes/bad.ply", "nonsense"}}));
  v1::SubmitJobResponse submitted;
  grpc::ClientContext context;
  rpc::set_deadline(context, kPatience);
  const grpc::Status status = v1::JobsService::NewStub(rpc::make_channel(address_))->SubmitJob(&context, request, &submitted);
  ASSERT_TRUE(status.ok()) << status.error_message();
  start_worker();
  ASSERT_EQ(watch(submitted.job_id()), 1);
  const std::string shown = show(submitted.job_id()).dump();
  EXPECT_THAT(shown, HasSubstr("bad.pbrt:4:"));
  EXPECT_THAT(shown, HasSubstr("meshes/bad.ply"));
  EXPECT_THAT(shown, ::testing::Not(HasSubstr((folder_ / "worker0").string()))) << "where the worker keeps them is its own business";
}

}  // namespace
}  // namespace woodcock::testing_service
