// Jobs that a user deletes, and the lists that are read meanwhile.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <functional>
#include <thread>

#include "tests/service/retention_world.h"
#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

using ::testing::HasSubstr;

TEST(Delete, AJobThatRunsIsRefusedByNameAndOneThatEndedIsGoneForEveryone) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path());
  const std::string id = world.submit("r1", 1, 1);
  EXPECT_THAT(refusal([&] { world.coordinator->remove(id, false); }, rpc::Code::kFailedPrecondition),
              HasSubstr("job " + id + " is queued"));
  EXPECT_EQ(world.render_all("w1"), 2);
  world.coordinator->remove(id, false);
  EXPECT_THAT(refusal([&] { world.coordinator->job(id); }, rpc::Code::kNotFound), HasSubstr(id));
  EXPECT_THAT(refusal([&] { world.coordinator->frame(id, 0, false); }, rpc::Code::kNotFound), HasSubstr(id));
  EXPECT_THAT(refusal([&] { world.coordinator->events(id, 0, ""); }, rpc::Code::kNotFound), HasSubstr(id));
  EXPECT_THAT(refusal([&] { world.coordinator->extend(id, 64, {}); }, rpc::Code::kNotFound), HasSubstr(id));
  bool finished = false;
  EXPECT_THAT(refusal([&] { world.coordinator->watch(id, 0, finished); }, rpc::Code::kNotFound), HasSubstr(id));
  EXPECT_THAT(refusal([&] { world.coordinator->remove(id, false); }, rpc::Code::kNotFound), HasSubstr(id));
  EXPECT_TRUE(world.jobs().empty());
  for (const std::function<void()>& call : std::vector<std::function<void()>>{
           [&] { world.coordinator->remove("", false); }, [&] { world.coordinator->job(""); }, [&] { world.coordinator->cancel(""); },
           [&] { world.coordinator->set_paused("", true); }, [&] { world.coordinator->events("", 0, ""); }})
    EXPECT_THAT(refusal(call, rpc::Code::kInvalidArgument), HasSubstr("job_id: found an empty text, expected the id of a job"));
  world.coordinator->clean_up();
  for (const char* table : {"jobs", "frames", "settled", "results", "events", "attempts", "leases", "deletions", "submissions"})
    EXPECT_EQ(world.rows(table), 0) << table;
  // The same request is a new job.
  EXPECT_EQ(world.submit("r1", 1, 1), id);
  EXPECT_EQ(world.render_all("w1"), 2) << "nothing of it is there any more";
}

TEST(Delete, WithCancelAJobThatRunsGoesWithItsLeases) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path());
  const std::string id = world.submit("r1", 1, 1, 3);
  world.sync(world.sync_request("w1"));
  ASSERT_GT(world.sync(world.sync_request("w1")).second.grants_size(), 0);
  world.coordinator->remove(id, true);
  EXPECT_TRUE(world.jobs().empty());
  EXPECT_EQ(world.work("w1"), 0);
  world.stop();
  world.start();
  world.coordinator->clean_up();
  for (const char* table : {"jobs", "frames", "settled", "results", "events", "leases", "deletions"})
    EXPECT_EQ(world.rows(table), 0) << table;
}

TEST(Delete, WhatAnotherJobHasStaysAndTheRestIsRemoved) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path());
  const std::string first = world.submit("r1", 1, 1), alone = world.submit("r2", 2, 2);
  EXPECT_EQ(world.render_all("w1"), 4);
  const std::string second = world.submit("r3", 1, 1);
  EXPECT_EQ(world.render_all("w1"), 0) << "its results were there";
  const std::string image = image_of(world, second);
  world.expect_exact_counts();
  world.coordinator->remove(first, false);
  world.coordinator->remove(alone, false);
  world.now += 2 * 3600 * kSecond;
  world.coordinator->clean_up();
  world.expect_exact_counts();
  world.expect_nothing_is_missing();
  EXPECT_EQ(world.on_disk(), world.referenced());
  EXPECT_TRUE(image_of(world, second) == image);
  EXPECT_TRUE(world.coordinator->blobs().contains(rpc::blob_digest("scene 1")));
  EXPECT_FALSE(world.coordinator->blobs().contains(rpc::blob_digest("scene 2")));
  // A later job still finds what the second has.
  world.submit("r4", 1, 1);
  EXPECT_EQ(world.render_all("w1"), 0);
  for (const v1::Job& job : world.jobs()) {
    world.coordinator->remove(job.job_id(), false);
  }
  world.now += 2 * 3600 * kSecond;
  world.coordinator->clean_up();
  EXPECT_TRUE(world.on_disk().empty());
}

TEST(Delete, ARestartGoesOnWithWhatIsHalfDeleted) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path());
  const std::string id = world.submit("r1", 1, 1, 3), other = world.submit("r2", 1, 1);
  world.render_all("w1");
  world.stop();
  {
    // As a crash leaves it: the job is out, some of its rows went.
    Store store({folder.path(), "", [](const std::string& reason) { ADD_FAILURE() << reason; }});
    EXPECT_TRUE(store.read([&](StoreSession& session) { return session.begin_delete(id); }));
    EXPECT_FALSE(store.read([&](StoreSession& session) { return session.delete_step(id, 2); }));
    JobSpec taken = test_job(id);
    EXPECT_FALSE(store.read([&](StoreSession& session) { return session.insert_job(taken); })) << "its rows would go with the old ones";
  }
  world.start();
  for (int i = 0; i < 500 && world.rows("deletions") > 0; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(world.rows("deletions"), 0) << "without being asked";
  EXPECT_EQ(world.rows("settled", "job_id = '" + id + "'"), 0);
  EXPECT_EQ(world.rows("events", "job_id = '" + id + "'"), 0);
  world.expect_exact_counts();
  EXPECT_EQ(world.jobs().size(), 1u);
  EXPECT_EQ(world.coordinator->job(other).state(), v1::JOB_STATE_DONE);
}

TEST(Delete, AListThatIsReadInPagesGoesOnWhereItsLastJobWent) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path());
  for (int i = 0; i < 5; ++i) {
    world.submit(fmt::format("r{}", i), i, 1);
    world.now += kSecond;
  }
  const v1::ListJobsResponse page = world.coordinator->list(2, "");
  ASSERT_EQ(page.jobs_size(), 2);
  world.coordinator->remove(page.jobs(1).job_id(), true);
  EXPECT_EQ(world.coordinator->list(10, page.next_page_token()).jobs_size(), 3);
  for (const char* token_of_nobody : {"x", "5", "5.", ".j", "5x.j", "5.j/"})
    EXPECT_THAT(refusal([&] { world.coordinator->list(2, token_of_nobody); }, rpc::Code::kInvalidArgument), HasSubstr("page_token"))
        << token_of_nobody;
}

TEST(Events, AreListedInPagesWithoutLossOrRepetition) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path());
  const std::string id = world.submit("r1", 1, 1);
  world.render_all("w1");
  const v1::Job job = world.coordinator->job(id);
  int64_t number = 0;
  std::string token;
  std::set<v1::JobEventKind> kinds;
  do {
    const v1::ListEventsResponse page = world.coordinator->events(id, 3, token);
    EXPECT_LE(page.events_size(), 3);
    for (const v1::JobEvent& event : page.events()) {
      EXPECT_EQ(event.number(), ++number);
      kinds.insert(event.kind());
    }
    token = page.next_page_token();
  } while (!token.empty());
  EXPECT_EQ(number, job.last_event());
  EXPECT_TRUE(kinds.contains(v1::JOB_EVENT_KIND_SUBMITTED) && kinds.contains(v1::JOB_EVENT_KIND_FRAME_DONE));
  EXPECT_EQ(world.coordinator->events(id, 0, std::to_string(number)).events_size(), 0);
  for (const char* token_of_nobody : {"x", "-1", "3x"})
    EXPECT_THAT(refusal([&] { world.coordinator->events(id, 3, token_of_nobody); }, rpc::Code::kInvalidArgument), HasSubstr("page_token"));
}

}  // namespace
}  // namespace woodcock::coordinator
