// F32: a job of many frames is written in steps. Nobody waits for all of them, nobody sees some of them.
#include <gtest/gtest.h>
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include <functional>
#include <string>
#include <thread>

#include "tests/service/large_jobs.h"
#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

/// A coordinator that stops after each step of a submit and lets `between` look at it.
struct Stepping {
  TemporaryFolder folder;
  std::function<void()> between = [] {};
  int steps = 0;
  CoordinatorWorld world{folder.path(), [this](CoordinatorOptions& options) {
                           options.failpoint = [this](const char* point) {
                             if (std::string(point) != "frames-written") return;
                             ++steps;
                             between();
                           };
                         }};

  int64_t rows(const std::string& table) const {
    soci::session sql(soci::sqlite3, "db=" + (folder / "woodcock.sqlite").string() + " timeout=5");
    long long count = 0;
    sql << "select count(*) from " + table, soci::into(count);
    return count;
  }
};

rpc::Code refused(const std::function<void()>& call) {
  try {
    call();
  } catch (const rpc::RpcError& error) {
    return error.code();
  }
  ADD_FAILURE() << "it was accepted";
  return rpc::Code::kInternal;
}

TEST(LargeSubmit, F32_ListsAreAnsweredBetweenItsStepsAndShowNothingOfIt) {
  Stepping farm;
  const std::string other = farm.world.coordinator->submit(farm.world.request("other")).job_id();
  const v1::SubmitJobRequest request = ten_thousand_frames(farm.world, "large", 2000);
  farm.between = [&] {
    const v1::ListJobsResponse list = farm.world.coordinator->list(0, "");
    ASSERT_EQ(list.jobs_size(), 1);
    EXPECT_EQ(list.jobs(0).job_id(), other);
    // A client that asks again before it was answered.
    EXPECT_EQ(refused([&] { farm.world.coordinator->submit(request); }), rpc::Code::kUnavailable);
  };
  const std::string id = farm.world.coordinator->submit(request).job_id();
  EXPECT_EQ(farm.steps, 8) << "of 250 frames";
  EXPECT_EQ(farm.world.coordinator->list(0, "").jobs_size(), 2);
  EXPECT_EQ(farm.world.coordinator->job(id).frames_size(), 2000);
  EXPECT_TRUE(farm.world.coordinator->submit(request).repeated_request());
  farm.world.stop();
  farm.world.start();
  const v1::Job job = farm.world.coordinator->job(id);
  ASSERT_EQ(job.frames_size(), 2000);
  for (int i = 0; i < 2000; ++i) ASSERT_EQ(job.frames(i).frame(), static_cast<uint64_t>(i));
  EXPECT_EQ(farm.rows("submissions"), 0);
}

TEST(LargeSubmit, F32_OneThatIsRefusedInTheMiddleLeavesNothing) {
  Stepping farm;
  const std::string first = farm.world.coordinator->submit(farm.world.request("first")).job_id();
  v1::SubmitJobRequest request = ten_thousand_frames(farm.world, "large", 600);
  request.mutable_policy()->add_after(first);
  farm.between = [&] {
    if (farm.steps == 2) farm.world.coordinator->remove(first, true);
  };
  EXPECT_EQ(refused([&] { farm.world.coordinator->submit(request); }), rpc::Code::kNotFound) << "what it was to wait for has gone";
  EXPECT_EQ(farm.steps, 3);
  for (int i = 0; i < 500 && farm.rows("frames") + farm.rows("submissions") + farm.rows("deletions") > 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(farm.rows("frames"), 0);
  EXPECT_EQ(farm.rows("submissions"), 0);
  request.mutable_policy()->clear_after();
  EXPECT_EQ(farm.world.coordinator->job(farm.world.coordinator->submit(request).job_id()).frames_size(), 600);
}

TEST(LargeSubmit, F32_WhatACrashLeavesOfItIsGoneAfterTheStart) {
  const TemporaryFolder folder;
  JobSpec spec = test_job("j1");
  for (uint64_t i = 1; i < 10; ++i) {
    spec.frames.push_back(spec.frames[0]);
    spec.frames[i].header.frame = i;
  }
  const NewJob rows(spec);
  const auto options = [&] { return StoreOptions{folder.path(), "", [](const std::string& reason) { ADD_FAILURE() << reason; }}; };
  {
    Store store(options());
    store.read([&](StoreSession& session) {
      session.begin_job("j1");
      return session.insert_frames(rows, 0, 7);
    });
    EXPECT_FALSE(store.load_job("j1"));
    EXPECT_TRUE(store.read([](StoreSession& session) { return session.is_being_submitted("j1"); }));
  }
  Store store(options());
  EXPECT_FALSE(store.read([](StoreSession& session) { return session.is_being_submitted("j1"); }));
  EXPECT_TRUE(store.read([](StoreSession& session) { return session.manifests(); }).empty()) << "no frame is there";
  EXPECT_TRUE(store.read([&](StoreSession& session) { return session.insert_job(rows); })) << "it can be submitted again";
  EXPECT_EQ(store.load_job("j1").value().job.frames.size(), 10u);
}

TEST(LargeSubmit, F32_AJobOfManyFramesIsReadAndCountedInPages) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = world.coordinator->submit(ten_thousand_frames(world, "large", 1300)).job_id();
  const v1::Job before = world.coordinator->job(id);
  world.coordinator->cancel(id);
  world.stop();
  // Neither now nor after a restart is a frame lost or shown twice.
  for (int start = 0; start < 2; ++start) {
    world.start();
    const v1::Job after = world.coordinator->job(id);
    ASSERT_EQ(after.frames_size(), 1300);
    for (int i = 0; i < after.frames_size(); ++i) {
      EXPECT_EQ(after.frames(i).header().SerializeAsString(), before.frames(i).header().SerializeAsString()) << i;
      EXPECT_EQ(after.frames(i).progress().tasks_total(), 100) << i;
    }
    EXPECT_EQ(world.coordinator->list(0, "").jobs(0).progress().tasks_total(), 130'000);
    world.stop();
  }
}

}  // namespace
}  // namespace woodcock::coordinator
