// Policies of jobs in a coordinator with its database: kept over restarts, refused by name, told to people.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/service/coordinator_world.h"

namespace woodcock::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int64_t kGib = int64_t{1} << 30;

/// Another picture for each, so that no job finds the results of another.
v1::SubmitJobRequest request_of(CoordinatorWorld& world, const std::string& id) {
  v1::SubmitJobRequest request = world.request(id);
  FrameHeader header = world.header();
  header.scene_digest = rpc::blob_digest(id);
  *request.mutable_frames(0)->mutable_header() = rpc::to_wire(header);
  return request;
}

std::string submit_after(CoordinatorWorld& world, const std::string& id, const std::vector<std::string>& after) {
  v1::SubmitJobRequest request = request_of(world, id);
  for (const std::string& job : after) request.mutable_policy()->add_after(job);
  return world.coordinator->submit(request).job_id();
}

rpc::Outcome outcome_of(const std::function<void()>& call) {
  try {
    call();
    return {};
  } catch (const rpc::RpcError& error) {
    return {error.code(), error.what()};
  }
}

TEST(PolicyOfJobs, IsKeptOverRestartsAndHeldTo) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  v1::SubmitJobRequest request = request_of(world, "r1");
  v1::JobPolicy& policy = *request.mutable_policy();
  policy.set_user("ada");
  policy.add_required_tags("gpu-room");
  policy.add_required_tags("big");
  policy.set_memory_bytes(8 * kGib);
  policy.set_max_workers(3);
  const std::string id = world.coordinator->submit(request).job_id();
  for (int start = 0; start < 2; ++start) {
    const v1::Job job = world.coordinator->job(id);
    EXPECT_EQ(job.policy().user(), "ada");
    EXPECT_THAT(job.policy().required_tags(), ElementsAre("big", "gpu-room"));
    EXPECT_EQ(job.policy().memory_bytes(), 8 * kGib);
    EXPECT_EQ(job.policy().max_workers(), 3u);
    world.incarnation = static_cast<uint64_t>(start) + 1;
    world.sequence = 0;
    EXPECT_EQ(world.work("plain"), 0);
    EXPECT_EQ(world.coordinator->job(id).frames(0).waiting_reason(), "no connected worker has the tag big");
    world.stop();
    world.start();
  }
  world.tags = {"big", "gpu-room"};
  world.memory = 8 * kGib;
  world.sequence = 0;
  EXPECT_EQ(world.work("fitting"), 4);
  EXPECT_EQ(world.wait_until_ended(id).state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(world.coordinator->job(id).policy().user(), "ada") << "also once it is in the database only";
  EXPECT_EQ(world.coordinator->list(0, "").jobs(0).policy().user(), "ada");
}

TEST(PolicyOfJobs, AJobBeginsAfterOthersAlsoWhenTheCoordinatorWasStartedAgain) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string first = submit_after(world, "r1", {}), second = submit_after(world, "r2", {});
  const std::string last = submit_after(world, "r3", {first, second});
  const auto restart = [&] {
    world.stop();
    world.start();
    world.sequence = 0;
    ++world.incarnation;
  };
  restart();
  EXPECT_THAT(world.coordinator->job(last).state_reason(), HasSubstr("and 1 other, after which it begins, are not done yet"));
  world.coordinator->set_paused(second, true);
  EXPECT_EQ(world.work("w1"), 4);
  EXPECT_EQ(world.wait_until_ended(first).state(), v1::JOB_STATE_DONE);
  restart();
  EXPECT_EQ(world.coordinator->job(last).state_reason(), "job " + second + ", after which it begins, is not done yet");
  EXPECT_EQ(world.work("w1"), 0);
  world.coordinator->set_paused(second, false);
  EXPECT_GE(world.work("w1", 4), 4);
  EXPECT_EQ(world.wait_until_ended(second).state(), v1::JOB_STATE_DONE);
  world.work("w1");
  EXPECT_EQ(world.wait_until_ended(last).state(), v1::JOB_STATE_DONE);
  // What is done already is waited for by nobody.
  const std::string late = submit_after(world, "r4", {first, last});
  EXPECT_EQ(world.work("w1"), 4);
  EXPECT_EQ(world.wait_until_ended(late).state(), v1::JOB_STATE_DONE);
  EXPECT_THAT(world.coordinator->job(late).policy().after(), ::testing::SizeIs(2));
}

TEST(PolicyOfJobs, AJobThatCannotBeginIsRefusedByNameOrFails) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const rpc::Outcome unknown = outcome_of([&] { submit_after(world, "r1", {"jnobody"}); });
  EXPECT_EQ(unknown.code, rpc::Code::kNotFound);
  EXPECT_THAT(unknown.message, HasSubstr("there is no job jnobody"));
  EXPECT_TRUE(world.coordinator->list(0, "").jobs().empty()) << "nothing of it is kept";

  const std::string first = submit_after(world, "r1", {});
  const std::string second = submit_after(world, "r2", {first});
  world.coordinator->cancel(first);
  const std::string why = "job " + first + ", after which this one was to begin, is cancelled";
  EXPECT_EQ(world.wait_until_ended(second).state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(world.coordinator->job(second).state_reason(), why);
  const rpc::Outcome late = outcome_of([&] { submit_after(world, "r3", {first}); });
  EXPECT_EQ(late.code, rpc::Code::kFailedPrecondition);
  EXPECT_THAT(late.message, HasSubstr("job " + first + " is cancelled"));
  // The same call again is the same job, whatever became of it.
  EXPECT_EQ(submit_after(world, "r2", {first}), second);
  world.stop();
  world.start();
  EXPECT_EQ(world.coordinator->job(second).state(), v1::JOB_STATE_FAILED);
  EXPECT_EQ(world.coordinator->job(second).state_reason(), why);
}

TEST(PolicyOfJobs, AWorkerThatLeavesIsAnsweredAtOnceAndListedAsLeft) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  world.tags = {"gpu", "big", "gpu"};
  world.memory = 32 * kGib;
  ASSERT_TRUE(world.sync(world.sync_request("w1")).first.ok());
  v1::WorkerStatus status = world.coordinator->list_workers(0, "").workers(0);
  EXPECT_EQ(status.condition(), v1::WORKER_CONDITION_READY);
  EXPECT_THAT(status.tags(), ElementsAre("big", "gpu"));
  EXPECT_EQ(status.memory_bytes(), 32 * kGib);
  v1::SyncRequest last = world.sync_request("w1");
  last.set_state(v1::WORKER_STATE_LEFT);
  const Time before = world.now;
  ASSERT_TRUE(world.sync(last).first.ok());
  EXPECT_LT(world.now - before, 5 * kSecond) << "a call with nothing to say is held for ten seconds";
  ASSERT_EQ(world.coordinator->list_workers(0, "").workers_size(), 1);
  EXPECT_EQ(world.coordinator->list_workers(0, "").workers(0).condition(), v1::WORKER_CONDITION_LEFT);
}

TEST(PolicyOfJobs, F22AWorkersTagsAreChecked) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const auto outcome = [&](const std::vector<std::string>& tags) {
    world.tags = tags;
    return world.sync(world.sync_request("w1")).first;
  };
  EXPECT_EQ(outcome({"a b"}).code, rpc::Code::kInvalidArgument);
  EXPECT_THAT(outcome({"\x1b[2J"}).message, ::testing::AllOf(HasSubstr("tags: "), ::testing::Not(HasSubstr("\x1b"))));
  EXPECT_EQ(outcome(std::vector<std::string>(33, "a")).code, rpc::Code::kInvalidArgument);
  EXPECT_TRUE(world.coordinator->list_workers(0, "").workers().empty());
}

}  // namespace
}  // namespace woodcock::coordinator
