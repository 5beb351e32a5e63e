// The whole coordinator in this process, over its own port where the wire matters.
#include <gtest/gtest.h>
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <cstdio>
#include <iterator>

#include "coordinator/merge_pool.h"
#include "coordinator/server.h"
#include "coordinator/submit.h"
#include "renderer/accuracy/error_summary.h"
#include "rpc/blob_transfer.h"
#include "rpc/channel.h"
#include "tests/service/coordinator_world.h"

namespace woodcock::coordinator {
namespace {

TEST(Coordinator, AJobIsTakenLeasedCommittedAndItsImageEqualsTheWholeFrame) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(world.request("r1", 12)).job_id();
  EXPECT_EQ(world.work("w1"), 8);  // 4 tiles × nodes [0,8) and [8,12)
  const v1::Job job = world.wait_until_ended(id);
  EXPECT_EQ(job.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(job.progress().samples_done(), 32 * 32 * 12);
  EXPECT_EQ(job.frames(0).statistics().pixels(), 32 * 32);
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 12));
}

TEST(Coordinator, ASubmitIsIdempotentByItsRequestId) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  v1::SubmitJobRequest request = world.request("r1");
  const std::string id = world.coordinator->submit(request).job_id();
  const v1::SubmitJobResponse again = world.coordinator->submit(request);
  EXPECT_EQ(again.job_id(), id);
  EXPECT_TRUE(again.repeated_request());
  request.set_priority(5);
  try {
    world.coordinator->submit(request);
    FAIL();
  } catch (const rpc::RpcError& error) {
    EXPECT_EQ(error.code(), rpc::Code::kAlreadyExists);
  }
}

TEST(Coordinator, F03F04ARestartAtAnyCommitEndsWithTheSameImageAndRendersNothingTwice) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(world.request("r1")).job_id();
  int committed = 0;
  for (int limit = 1; committed < 4; ++limit) {
    committed += world.work("w1", 1);
    world.stop();
    world.start();
    ++world.incarnation;
    ASSERT_LT(limit, 10);
  }
  EXPECT_EQ(world.wait_until_ended(id).state(), v1::JOB_STATE_DONE);
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 8));
}

TEST(Coordinator, AnAdaptiveJobGoesOnAcrossRestartsUntilItsTargetAndIsExtended) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  v1::SubmitJobRequest request = world.request("r1", 4096);
  request.mutable_target()->set_error(0.022);
  request.mutable_target()->set_max_samples(4096);
  const std::string id = world.coordinator->submit(request).job_id();
  int partials = 0;
  const auto work_to_the_end = [&] {
    for (int i = 0; i < 100 && world.coordinator->job(id).state() < v1::JOB_STATE_DONE; ++i) {
      world.work("w1", 1);
      // In the middle of a pass its block counts with what it had before.
      const v1::FrameStatus frame = world.coordinator->job(id).frames(0);
      if (frame.adaptive().pass() > 1 && frame.state() == v1::FRAME_STATE_RUNNING) {
        const v1::GetFrameResponse partial = world.coordinator->frame(id, 0, true);
        EXPECT_EQ(partial.statistics().missing_pixels(), 0);
        ++partials;
      }
      world.stop();
      world.start();
      ++world.incarnation;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return world.wait_until_ended(id);
  };
  // The samples are their index + 1: E = √(mean square of r_k − x̄ / 3)/x̄ = 1.29/n, up to the floor.
  const v1::Job job = work_to_the_end();
  EXPECT_EQ(job.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(job.target().max_samples(), 4096);
  EXPECT_GT(job.frames(0).adaptive().pass(), 1);
  EXPECT_LE(job.frames(0).statistics().relative_error(), 0.022);
  EXPECT_EQ(job.frames(0).statistics().samples(), 64);
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 64));

  const auto refused = [&](int64_t samples, std::optional<double> error) {
    try {
      world.coordinator->extend(id, samples, error);
    } catch (const rpc::RpcError& e) {
      return e.code() == rpc::Code::kInvalidArgument;
    }
    return false;
  };
  EXPECT_TRUE(refused(0, 0.5));
  EXPECT_TRUE(refused(0, -1));
  EXPECT_TRUE(refused(64, 0.01));
  EXPECT_TRUE(refused(int64_t{1} << 40, 0.01));
  world.coordinator->extend(id, 0, 0.011);
  const v1::Job more = work_to_the_end();
  EXPECT_EQ(more.frames(0).statistics().samples(), 128);
  EXPECT_GT(partials, 0);
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 128));
}

TEST(Coordinator, AnExtensionWhileTheFrameIsMergedIsNotLost) {
  for (const bool to_a_target : {false, true}) {
    const TemporaryFolder folder;
    std::function<void()> meanwhile;
    CoordinatorWorld world(folder.path(), [&](CoordinatorOptions& options) {
      options.assemble_tiles = [&](const AssembleRequest& request) {
        const AssembleResult result = assemble(request);
        if (meanwhile) std::exchange(meanwhile, nullptr)();
        return result;
      };
    });
    const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
    meanwhile = [&] {
      if (to_a_target)
        world.coordinator->extend(id, 24, 1e-6);
      else
        world.coordinator->extend(id, 24, {});
    };
    for (int i = 0; i < 200 && world.coordinator->job(id).state() < v1::JOB_STATE_DONE; ++i) {
      world.work("w1");
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    EXPECT_EQ(world.wait_until_ended(id).frames(0).statistics().samples(), 24);
    EXPECT_TRUE(image_of(world, id) == whole_frame(world, 24)) << to_a_target;
  }
}

TEST(Coordinator, ATimeAloneMakesAPlainJobGoWhereTheErrorIs) {
  JobSpec plain;
  plain.rounds = {{0, 16}};
  EXPECT_EQ(extended_target(plain, 0, {}, true), (SamplingTarget{0, SamplingTarget{}.max_samples}));
  plain.target = SamplingTarget{0, 64};  // of time alone
  EXPECT_EQ(extended_target(plain, 0, 0.5, false), (SamplingTarget{0.5, 64}));
  EXPECT_THROW(extended_target(plain, 128, {}, false), rpc::RpcError);
}

TEST(Coordinator, AFinalStateIsShownOnlyOnceItsRowIsDurable) {
  const TemporaryFolder folder;
  std::unique_ptr<soci::session> reader;
  std::atomic<bool> blocked{false};
  CoordinatorWorld world(folder.path(), [&](CoordinatorOptions& options) {
    options.failpoint = [&](const char* point) {
      if (std::string_view(point) != "after-publish") return;
      // SQLite commits nothing while another connection reads.
      reader = std::make_unique<soci::session>(soci::sqlite3, "db=" + (folder / "woodcock.sqlite").string());
      int frames = 0;
      *reader << "begin";
      *reader << "select count(*) from frames", soci::into(frames);
      blocked = true;
    };
  });
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  EXPECT_EQ(world.work("w1", 4), 4);
  for (int i = 0; i < 500 && !blocked; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_TRUE(blocked) << "the fault did not fire";
  const auto until_done = [&](auto ask) {
    return std::async(std::launch::async, [&world, ask] {
      while (ask() != v1::JOB_STATE_DONE) std::this_thread::sleep_for(std::chrono::milliseconds(2));
    });
  };
  std::vector<std::future<void>> seen;
  seen.push_back(until_done([&] { return world.coordinator->job(id).state(); }));
  seen.push_back(until_done([&] { return world.coordinator->list(0, "").jobs(0).state(); }));
  seen.push_back(until_done([&] {
    bool finished = false;
    return world.coordinator->watch(id, 0, finished).job().state();
  }));
  EXPECT_EQ(seen[0].wait_for(std::chrono::milliseconds(500)), std::future_status::timeout) << "told before it was durable";
  for (const auto& one : seen) EXPECT_EQ(one.wait_for(std::chrono::milliseconds(0)), std::future_status::timeout);
  reader.reset();
  for (auto& one : seen) one.get();
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 8));
}

TEST(Coordinator, ACommittedKeyIsNeverRenderedAgain) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string first = world.coordinator->submit(world.request("r1", 8)).job_id();
  EXPECT_EQ(world.work("w1"), 4);
  world.wait_until_ended(first);
  const std::string second = world.coordinator->submit(world.request("r2", 8)).job_id();
  EXPECT_EQ(world.work("w1"), 0);
  EXPECT_EQ(world.wait_until_ended(second).state(), v1::JOB_STATE_DONE);
  EXPECT_LT(world.coordinator->extend(second, 16, {}).state(), v1::JOB_STATE_ASSEMBLING);
  EXPECT_EQ(world.work("w1"), 4);
  world.wait_until_ended(second);
  EXPECT_TRUE(image_of(world, second) == whole_frame(world, 16));
}

TEST(Coordinator, F06ATileDamagedAtRestIsRenderedAgain) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  EXPECT_EQ(world.work("w1", 2), 2);
  for (const auto& entry : std::filesystem::recursive_directory_iterator((folder / "blobs").string()))
    if (entry.is_regular_file() && entry.file_size() > 1000) std::ofstream(entry.path(), std::ios::app) << "x";
  ++world.incarnation;
  EXPECT_GE(world.work("w1"), 2);
  for (int i = 0; i < 20 && world.coordinator->job(id).state() < v1::JOB_STATE_DONE; ++i) {
    world.work("w1");
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(world.wait_until_ended(id).state(), v1::JOB_STATE_DONE);
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 8));
}

TEST(Coordinator, F21ATileThatIsNoTileIsNamedByTheMergeAndMakesNoImage) {
  const TemporaryFolder folder;
  const std::string path = (folder / "bad.exr").string();
  std::ofstream(path) << "no EXR at all";
  AssembleRequest request;
  request.header.scene_digest = request.header.settings_digest = std::string(64, 'a');
  request.header.width = request.header.height = 8;
  request.header.bounds = {0, 0, 8, 8};
  request.map = {request.header.bounds, {1}};
  request.tile_paths = {path};
  request.output_path = (folder / "out.exr").string();
  MergePool pool(WOODCOCK_BIN_DIR "/woodcock-coordinator", 1);
  for (const AssembleResult& result : {assemble(request), pool.merge(request)}) {
    EXPECT_FALSE(result.ok);
    EXPECT_EQ(result.damaged, std::vector<size_t>{0}) << result.error;
    EXPECT_FALSE(std::filesystem::exists(request.output_path));
  }
}

TEST(Coordinator, APartialImageCountsWhatIsMissing) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  EXPECT_THROW(world.coordinator->frame(id, 0, true), rpc::RpcError);
  EXPECT_EQ(world.work("w1", 1), 1);
  const v1::GetFrameResponse partial = world.coordinator->frame(id, 0, true);
  EXPECT_TRUE(partial.partial());
  EXPECT_EQ(partial.statistics().missing_pixels(), 32 * 32 - 16 * 16);
}

TEST(Coordinator, EventsAreNumberedWithoutGapsAndWatchResumesFromItsCursor) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  world.work("w1");
  world.wait_until_ended(id);
  world.stop();
  world.start();
  int64_t cursor = 0;
  int commits = 0;
  for (bool finished = false; !finished;) {
    const v1::WatchJobResponse response = world.coordinator->watch(id, cursor, finished);
    for (const v1::JobEvent& event : response.events()) {
      EXPECT_EQ(event.number(), ++cursor);
      commits += event.kind() == v1::JOB_EVENT_KIND_TASK_COMMITTED;
    }
  }
  EXPECT_EQ(commits, 4);
}

TEST(Coordinator, CleanUpLeavesWhatAJobNeeds) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  put_blob(world.coordinator->blobs(), "orphan");
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  world.work("w1");
  world.wait_until_ended(id);
  world.now += 2 * 3600 * kSecond;
  world.coordinator->sweep();
  EXPECT_FALSE(world.coordinator->blobs().contains(rpc::blob_digest("orphan")));
  EXPECT_TRUE(world.coordinator->blobs().contains(rpc::blob_digest("scene")));
  EXPECT_TRUE(image_of(world, id) == whole_frame(world, 8));
  EXPECT_TRUE(std::filesystem::is_empty((folder / "temporary").string()));
}

TEST(Coordinator, F22MalformedSubmitsAreRefusedByField) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const auto code = [&](const std::function<void(v1::SubmitJobRequest&)>& spoil) {
    v1::SubmitJobRequest request = world.request("r1");
    spoil(request);
    try {
      world.coordinator->submit(request);
      return rpc::Code::kOk;
    } catch (const rpc::RpcError& error) {
      return error.code();
    }
  };
  EXPECT_EQ(code([](auto& r) { r.set_request_id("../x"); }), rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.mutable_settings()->clear_samples(); }), rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.mutable_settings()->set_tile_size(7); }), rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.mutable_target()->set_max_samples(64); }), rpc::Code::kInvalidArgument);  // no error, no time
  EXPECT_EQ(code([](auto& r) {
              r.mutable_target()->set_max_samples(64);
              r.mutable_target()->set_max_seconds(std::numeric_limits<double>::infinity());
            }),
            rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.clear_frames(); }), rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { *r.add_frames() = r.frames(0); }), rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.mutable_frames(0)->set_scene_file("other.pbrt"); }), rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.mutable_frames(0)->mutable_header()->mutable_resolution()->set_width(1 << 30); }),
            rpc::Code::kInvalidArgument);
  EXPECT_EQ(code([](auto& r) { r.mutable_frames(0)->set_manifest_digest(std::string(64, '0')); }), rpc::Code::kFailedPrecondition);
  EXPECT_EQ(world.coordinator->list(0, "").jobs_size(), 0);
}

class OverTheWire : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  CoordinatorWorld world_{folder_.path()};
  CoordinatorServer server_{*world_.coordinator, "127.0.0.1:0"};
  std::shared_ptr<grpc::Channel> channel_ = rpc::make_channel(server_.address());
};

TEST_F(OverTheWire, BlobsGoUpAndDownVerified) {
  const auto blobs = v1::BlobsService::NewStub(channel_);
  std::string bytes(5'000'000, '\0');
  for (size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<char>(i * 2654435761u >> 13);
  const std::string digest = rpc::blob_digest(bytes);
  EXPECT_EQ(rpc::find_missing(*blobs, {digest}).size(), 1u);
  EXPECT_EQ(rpc::upload_bytes(*blobs, bytes), digest);
  EXPECT_TRUE(rpc::find_missing(*blobs, {digest}).empty());
  EXPECT_TRUE(rpc::download_bytes(*blobs, digest, 10'000'000) == bytes);
  const std::string path = (folder_ / "copy").string();
  std::ofstream(path + ".part") << bytes.substr(0, 1'234'567);
  rpc::download_file(*blobs, digest, path, true);
  std::ifstream copy(path, std::ios::binary);
  EXPECT_TRUE(std::string(std::istreambuf_iterator<char>(copy), {}) == bytes);
  EXPECT_FALSE(std::filesystem::exists(path + ".part"));
  EXPECT_EQ(rpc::upload_bytes(*blobs, ""), rpc::blob_digest(""));
  EXPECT_EQ(rpc::download_bytes(*blobs, rpc::blob_digest(""), 10), "");
}

TEST_F(OverTheWire, F19AWrongProtocolIsRefusedWithTheReasonAndAnOldIncarnationAborted) {
  const auto workers = v1::WorkersService::NewStub(channel_);
  const auto call = [&](const v1::SyncRequest& request) {
    grpc::ClientContext context;
    rpc::set_deadline(context, std::chrono::seconds(20));
    v1::SyncResponse response;
    // A report of a lease that is not known is answered at once.
    v1::SyncRequest with_lease = request;
    v1::LeaseReport* lease = with_lease.add_leases();
    lease->set_lease_id("L1");
    lease->set_task_id("j.0.0");
    return workers->Sync(&context, with_lease, &response);
  };
  v1::SyncRequest request = world_.sync_request("w1");
  request.mutable_protocol()->set_major(99);
  const grpc::Status status = call(request);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::FAILED_PRECONDITION);
  EXPECT_NE(status.error_message().find("99"), std::string::npos);
  request = world_.sync_request("w1");
  request.set_incarnation(5);
  EXPECT_TRUE(call(request).ok());
  request.set_incarnation(4);
  EXPECT_EQ(call(request).error_code(), grpc::StatusCode::ABORTED);
}

TEST_F(OverTheWire, AHeldSyncIsAnsweredWhenAJobComesAndReleasedWhenTheCallerGoes) {
  const auto workers = v1::WorkersService::NewStub(channel_);
  const auto jobs = v1::JobsService::NewStub(channel_);
  {
    grpc::ClientContext context;
    rpc::set_deadline(context, std::chrono::seconds(20));
    v1::SyncResponse response;
    EXPECT_TRUE(workers->Sync(&context, world_.sync_request("w1"), &response).ok()) << "the first call of a process is not held";
  }
  {
    grpc::ClientContext context;
    rpc::set_deadline(context, std::chrono::milliseconds(200));
    v1::SyncResponse response;
    EXPECT_EQ(workers->Sync(&context, world_.sync_request("w1"), &response).error_code(), grpc::StatusCode::DEADLINE_EXCEEDED);
  }
  v1::SubmitJobRequest submit = world_.request("r1");
  auto held = std::async(std::launch::async, [&, request = world_.sync_request("w1")] {
    grpc::ClientContext context;
    rpc::set_deadline(context, std::chrono::seconds(20));
    v1::SyncResponse response;
    const grpc::Status status = workers->Sync(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    return response;
  });
  EXPECT_EQ(held.wait_for(std::chrono::milliseconds(300)), std::future_status::timeout);
  grpc::ClientContext context;
  rpc::set_deadline(context, std::chrono::seconds(20));
  v1::SubmitJobResponse submitted;
  ASSERT_TRUE(jobs->SubmitJob(&context, submit, &submitted).ok());
  const v1::SyncResponse response = held.get();
  ASSERT_EQ(response.grants_size(), 2);
  EXPECT_EQ(response.grants(0).task().job_id(), submitted.job_id());
  EXPECT_EQ(response.coordinator_addresses(0), server_.address());
}

TEST_F(OverTheWire, AnUnknownJobIsNotFoundAndSaysWhatToDo) {
  const auto jobs = v1::JobsService::NewStub(channel_);
  grpc::ClientContext context;
  rpc::set_deadline(context, std::chrono::seconds(20));
  v1::GetJobRequest request;
  request.set_job_id("j404");
  v1::GetJobResponse response;
  const grpc::Status status = jobs->GetJob(&context, request, &response);
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_NE(status.error_message().find("woodcock jobs"), std::string::npos);
}

TEST(CoordinatorProgram, LoadsNoSceneLibraries) {
  // What it links itself; OpenImageIO brings libraries of its own, as packaged.
  FILE* pipe = ::popen("readelf -d " WOODCOCK_BIN_DIR "/woodcock-coordinator", "r");
  ASSERT_NE(pipe, nullptr);
  std::string text;
  for (char line[512]; std::fgets(line, sizeof line, pipe);) text += line;
  ASSERT_EQ(::pclose(pipe), 0);
  EXPECT_NE(text.find("NEEDED"), std::string::npos);
  EXPECT_EQ(text.find("libembree"), std::string::npos);
  EXPECT_EQ(text.find("libopenvdb"), std::string::npos);
}

}  // namespace
}  // namespace woodcock::coordinator
