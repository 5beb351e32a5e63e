// Jobs that go by the limits of retention, and the files that nobody has any more: what others have stays.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <random>
#include <thread>

#include "tests/service/fast_motion.h"
#include "tests/service/retention_world.h"
#include "tests/support/little_kept_back.h"

namespace woodcock::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Retention, JobsGoByAgeAndThoseThatRunOrJustEndedStay) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path(), [](CoordinatorOptions& options) { options.retention.keep_seconds = 90 * 86400; });
  const std::string old = world.submit("r1", 1, 1);
  world.render_all("w1");
  world.now += 80 * kDay;
  const std::string younger = world.submit("r2", 2, 2), runs = world.submit("r3", 3, 3);
  world.coordinator->cancel(younger);
  world.now += 9 * kDay;
  EXPECT_TRUE(ids(world.coordinator->clean_up()).empty());
  world.now += 2 * kDay;
  EXPECT_THAT(ids(world.dry_run()), ElementsAre(old));
  EXPECT_EQ(world.jobs().size(), 3u) << "a dry run changes nothing";
  EXPECT_THAT(ids(world.coordinator->clean_up()), ElementsAre(old));
  world.now += 200 * kDay;
  EXPECT_THAT(ids(world.coordinator->clean_up()), ElementsAre(younger));
  EXPECT_EQ(world.coordinator->job(runs).state(), v1::JOB_STATE_QUEUED) << "however old it is";
  EXPECT_EQ(world.render_all("w1"), 2);
}

TEST(Retention, BySizeTheOldestGoAndNoMoreThanMust) {
  const TemporaryFolder folder;
  RetentionLimits limits;
  RetentionWorld world(folder.path(), [&](CoordinatorOptions& options) { options.retention = limits; });
  std::vector<std::string> jobs;
  for (int i = 0; i < 6; ++i) {
    jobs.push_back(world.submit(fmt::format("r{}", i), i, i));
    world.render_all("w1");
    world.now += 3600 * kSecond;
  }
  const int64_t all = world.bytes();
  EXPECT_EQ(world.dry_run().bytes_before(), all);
  EXPECT_EQ(world.dry_run().jobs_total(), 0);
  world.stop();
  limits.keep_bytes = all - 1;
  world.start();
  world.now += 2 * 3600 * kSecond;
  const v1::RetainJobsResponse plan = world.dry_run();
  EXPECT_THAT(ids(plan), ElementsAre(jobs[0])) << "one suffices";
  EXPECT_EQ(plan.jobs(0).cause(), v1::RETENTION_CAUSE_SIZE);
  EXPECT_EQ(ids(world.coordinator->clean_up()), ids(plan));
  EXPECT_EQ(world.bytes(), all - plan.freed_bytes()) << "what was said is what it freed";
  EXPECT_EQ(world.on_disk(), world.referenced());
  v1::RetainJobsRequest request;
  request.set_keep_bytes(1);
  EXPECT_THAT(refusal([&] { world.coordinator->retain(request); }, rpc::Code::kInvalidArgument), HasSubstr("only with dry_run"));
  request.set_dry_run(true);
  EXPECT_EQ(world.coordinator->retain(request).jobs_total(), 5) << "other limits can be tried";
  EXPECT_EQ(world.coordinator->retain(request).bytes_after(), 0);
  EXPECT_EQ(world.jobs().size(), 5u);
}

TEST(Retention, ASizeIsFreedOnlyWithTheLastJobThatShares) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path(), [](CoordinatorOptions& options) { options.retention.keep_bytes = 1; });
  const std::string first = world.submit("r1", 1, 1);
  world.render_all("w1");
  world.now += kSecond;
  const std::string second = world.submit("r2", 1, 1);
  world.render_all("w1");
  const int64_t all = world.bytes();
  world.now += 2 * 3600 * kSecond;
  const v1::RetainJobsResponse plan = world.dry_run();
  ASSERT_THAT(ids(plan), ElementsAre(first, second));
  EXPECT_EQ(plan.jobs(0).freed_bytes(), 0);
  EXPECT_EQ(plan.jobs(1).freed_bytes(), all);
  const v1::RetainJobsResponse went = world.coordinator->clean_up();
  ASSERT_THAT(ids(went), ElementsAre(first, second));
  EXPECT_EQ(went.jobs(0).freed_bytes(), 0);
  EXPECT_EQ(went.jobs(1).freed_bytes(), all);
  EXPECT_TRUE(world.on_disk().empty());
}

TEST(Retention, WithoutLimitsTheBytesAreSaidAsADryRunSaysThem) {
  const TemporaryFolder folder;
  RetentionWorld world(folder.path());
  world.submit("r1", 1, 1);
  world.render_all("w1");
  const int64_t all = world.bytes();
  ASSERT_GT(all, 0);
  for (const bool dry_run : {true, false}) {
    v1::RetainJobsRequest request;
    request.set_dry_run(dry_run);
    const v1::RetainJobsResponse answer = world.coordinator->retain(request);
    EXPECT_EQ(answer.bytes_before(), all) << dry_run;
    EXPECT_EQ(answer.bytes_after(), all) << dry_run;
    EXPECT_EQ(answer.jobs_total(), 0) << dry_run;
  }
}

TEST(Retention, F26_AListOfFilesThatCannotBeReadStopsNoCleanUpAndCostsNoFileOfItsScene) {
  namespace fs = std::filesystem;
  const TemporaryFolder folder;
  RetentionWorld world(folder.path(), [](CoordinatorOptions& options) { options.retention.keep_seconds = 30 * 86400; });
  const auto made = [&](const std::string& digest, int64_t unix_ms) {
    const auto age = std::chrono::system_clock::now().time_since_epoch() - std::chrono::milliseconds(unix_ms);
    fs::last_write_time(world.coordinator->blobs().path(digest), fs::file_time_type::clock::now() - age);
  };
  const auto here = [&](const std::string& text) { return world.coordinator->blobs().contains(rpc::blob_digest(text)); };
  const auto now_ms = [&] { return kStartUnixMs + world.now / 1'000'000; };
  // Of a job that goes by its age, and of one whose list cannot be read.
  const std::string old = world.submit("r1", 1, 1);
  const std::set<std::string> of_old = world.referenced();
  for (const std::string& digest : of_old) made(digest, now_ms());
  world.coordinator->cancel(old);
  world.now += 20 * kDay;
  const std::string kept = world.submit("r2", 2, 2);
  for (const std::string& digest : world.referenced())
    if (!of_old.contains(digest)) made(digest, now_ms());
  world.coordinator->cancel(kept);
  const auto content = [&](const std::string& digest) {
    std::ifstream in(world.coordinator->blobs().path(digest));
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  std::string list;
  for (const std::string& digest : world.referenced())
    if (!of_old.contains(digest) && content(digest).find("scene.pbrt") != std::string::npos) list = digest;
  ASSERT_FALSE(list.empty());
  const std::string list_path = world.coordinator->blobs().path(list);
  fs::rename(list_path, folder / "list");
  std::ofstream(list_path) << "damaged";
  made(list, now_ms());
  // Nobody refers to it, and it came long after both.
  world.now += 5 * kDay;
  world.upload("orphan");
  made(rpc::blob_digest("orphan"), now_ms());
  world.now += 10 * kDay;
  EXPECT_THAT(ids(world.dry_run()), ElementsAre(old));
  EXPECT_THAT(ids(world.coordinator->clean_up()), ElementsAre(old)) << "limits hold all the same";
  EXPECT_FALSE(here("orphan"));
  EXPECT_TRUE(here("scene 2")) << "the list may be readable tomorrow";
  EXPECT_TRUE(here("scene 1")) << "it is as old, and might be of the same scene";
  // When the list is there again, what is not on it goes.
  fs::rename(folder / "list", list_path);
  world.coordinator->clean_up();
  EXPECT_TRUE(here("scene 2"));
  EXPECT_FALSE(here("scene 1"));
  EXPECT_EQ(world.on_disk(), world.referenced());
}

TEST(Retention, F12_AWallClockThatJumpsAheadTakesNoJob) {
  const TemporaryFolder folder;
  std::atomic<int64_t> jump_ms{0};
  RetentionWorld world(folder.path(), [&](CoordinatorOptions& options) {
    options.retention.keep_seconds = 86400;
    options.unix_ms = [&jump_ms, unix_ms = options.unix_ms] { return unix_ms() + jump_ms; };
  });
  const std::string id = world.submit("r1", 1, 1);
  world.coordinator->cancel(id);
  world.now += kDay / 2;
  jump_ms = 10LL * 365 * 86'400'000;
  EXPECT_TRUE(ids(world.coordinator->clean_up()).empty());
  world.now += kDay;
  EXPECT_THAT(ids(world.coordinator->clean_up()), ElementsAre(id)) << "time that passes counts";
}

/// Renders what `worker` is given until nothing is left, sending again what a clean-up took before it was offered.
void render_everything(RetentionWorld& world, const std::string& worker) {
  std::map<std::string, v1::LeaseGrant> held;
  for (int idle = 0; idle < 3;) {
    v1::SyncRequest request = world.sync_request(worker);
    for (const auto& [id, grant] : held) {
      const std::string tile = CoordinatorWorld::tile_bytes(grant.task());
      world.upload(tile);
      add_offer(request, grant, tile);
    }
    const auto [outcome, response] = world.sync(request);
    ASSERT_TRUE(outcome.ok()) << outcome.message;
    for (const v1::OfferVerdict& verdict : response.verdicts())
      if (verdict.verdict() != v1::VERDICT_RETRY_LATER && verdict.verdict() != v1::VERDICT_UPLOAD_NEEDED) held.erase(verdict.lease_id());
    for (const v1::LeaseCancellation& cancelled : response.cancellations()) held.erase(cancelled.lease_id());
    for (const v1::LeaseGrant& grant : response.grants()) held[grant.lease_id()] = grant;
    idle = held.empty() ? idle + 1 : 0;
  }
}

TEST(Retention, CleanUpsBesideSubmitsCommitsAndDeletionsTakeNothingThatIsReferredTo) {
  const TemporaryFolder folder;
  // Pins are over almost at once: what is on its way to the database must stay all the same.
  RetentionWorld world(folder.path(), [](CoordinatorOptions& options) {
    options.pin = kSecond / 10;
    options.scheduler.lease = options.scheduler.worker_timeout = kDay;
    options.merges_at_once = 2;
  });
  std::atomic<bool> stop{false};
  std::atomic<int> clean_ups{0};
  std::thread cleaner([&] {
    while (!stop) {
      world.now += kSecond / 5;
      world.coordinator->clean_up();
      ++clean_ups;
    }
  });
  std::mt19937 random(3);
  std::vector<std::string> jobs;
  const auto submit = [&](int i) {
    const int look = static_cast<int>(random() % 3), scene = static_cast<int>(random() % 2);
    for (;;) {
      try {
        return world.submit(fmt::format("r{}", i), look, scene);
      } catch (const rpc::RpcError& error) {
        // A file went between its upload and the submit, which names it.
        EXPECT_EQ(error.code(), rpc::Code::kFailedPrecondition) << error.what();
      }
    }
  };
  for (int i = 0; i < 40; ++i) {
    jobs.push_back(submit(i));
    if (i % 3 == 2) render_everything(world, "w1");
    if (HasFatalFailure()) break;
    if (random() % 3 == 0) {
      world.coordinator->remove(jobs.front(), true);
      jobs.erase(jobs.begin());
    }
  }
  const auto rendered = [&](const std::string& id) { return world.coordinator->job(id).state() >= v1::JOB_STATE_ASSEMBLING; };
  for (int i = 0; i < 100 && !std::all_of(jobs.begin(), jobs.end(), rendered); ++i) render_everything(world, "w1");
  for (const std::string& id : jobs) EXPECT_EQ(world.wait_until_ended(id).state(), v1::JOB_STATE_DONE);
  stop = true;
  cleaner.join();
  world.expect_nothing_is_missing();
  world.expect_exact_counts();
  EXPECT_GT(clean_ups, 10);
  int damaged = 0;
  for (const std::string& id : jobs) {
    const v1::ListEventsResponse page = world.coordinator->events(id, 1000, "");
    for (const v1::JobEvent& event : page.events()) damaged += event.kind() == v1::JOB_EVENT_KIND_RESULT_REFUSED;
  }
  EXPECT_EQ(damaged, 0) << "no tile or image was ever gone";
}

/// Submits, renders, cancels, extends, deletes and cleans up at random, with results, images and files that jobs share.
class RandomHistory : public ::testing::TestWithParam<unsigned> {};

TEST_P(RandomHistory, WhatIsReferredToStaysWhatIsNotAndIsOldGoesAndADryRunSaysWhich) {
  std::mt19937 random(GetParam());
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  const TemporaryFolder folder;
  RetentionLimits limits;
  if (below(2) == 0) limits.keep_seconds = 86400 * (1 + below(5));
  if (below(2) == 0) limits.keep_bytes = 5'000 + 1000 * below(60);
  RetentionWorld world(folder.path(), [&](CoordinatorOptions& options) { options.retention = limits; });
  int requests = 0;
  for (int step = 0; step < 14; ++step) {
    for (int i = below(4); i >= 0; --i) world.submit(fmt::format("r{}", ++requests), below(5), below(4), 1 + below(3));
    const std::vector<v1::Job> jobs = world.jobs();
    const std::string some = jobs.empty() ? "" : jobs[static_cast<size_t>(below(static_cast<int>(jobs.size())))].job_id();
    if (!some.empty() && below(4) == 0) world.coordinator->cancel(some);
    if (below(3) > 0) {
      world.render_all("w1");
    }
    if (!some.empty() && below(3) == 0) world.coordinator->remove(some, true);
    if (!some.empty() && below(6) == 0) {
      try {
        world.coordinator->extend(some, 16, {});
      } catch (const rpc::RpcError&) {
        // It went, or was cancelled.
      }
    }
    if (below(5) == 0) {
      world.stop();
      world.start();
    }
    world.now += below(3) * kDay / 2;
    // Some of it still runs: limits take what has ended only.
    std::set<std::string> running;
    for (const v1::Job& job : world.jobs())
      if (job.state() < v1::JOB_STATE_DONE) running.insert(job.job_id());
    const v1::RetainJobsResponse plan = world.dry_run();
    const v1::RetainJobsResponse went = world.coordinator->clean_up();
    EXPECT_EQ(ids(plan), ids(went));
    EXPECT_EQ(plan.bytes_after(), limits.any() ? went.bytes_after() : plan.bytes_before());
    EXPECT_EQ(plan.bytes_after(), world.bytes());
    for (const std::string& id : ids(went)) EXPECT_FALSE(running.contains(id)) << id;
    world.expect_exact_counts();
    world.expect_nothing_is_missing();
    if (::testing::Test::HasFailure()) return;
  }
  world.render_all("w1");
  world.now += 2 * 3600 * kSecond;
  world.coordinator->clean_up();
  EXPECT_EQ(world.on_disk(), world.referenced()) << "nothing else is left, and nothing of it lacks";
  EXPECT_TRUE(limits.keep_bytes == 0 || world.bytes() <= limits.keep_bytes || world.jobs().empty());
  for (const v1::Job& job : world.jobs()) {
    const int64_t age_ms = kStartUnixMs + world.now / 1'000'000 - job.ended_unix_ms();
    EXPECT_TRUE(limits.keep_seconds == 0 || age_ms <= 1000 * (limits.keep_seconds + 1)) << age_ms;
    EXPECT_TRUE(job.state() != v1::JOB_STATE_DONE || !image_of(world, job.job_id()).empty());
  }
}

INSTANTIATE_TEST_SUITE_P(Seeds, RandomHistory, ::testing::Range(1u, 7u));

TEST(FastMotion, F32_TwoThousandSmallJobsLeaveTheMemoryFlat) {
  const FastMotion motion = fast_motion(2048, 64, 2);
  EXPECT_LT(motion.memory_late - motion.memory_early, int64_t{8} << 20);
  EXPECT_LT(motion.database_late, 2 * motion.database_early);
}

TEST(BlobStore, ACleanUpThatRacesUploadsAndHoldsLosesNoAcknowledgedBlob) {
  const TemporaryFolder folder;
  // Pins end at once: what an upload was told, and what is held, must stay all the same.
  BlobStore blobs({folder.path(), 1, 1}, 0);
  std::atomic<Time> now{kSecond};
  std::atomic<bool> done{false};
  std::mutex mutex;
  std::set<std::string> rows;  // what a database would refer to
  std::atomic<size_t> removed{0};
  std::thread sweeper([&] {
    while (!done) {
      const BlobStore::Mark mark = blobs.begin_mark(++now);
      DigestSet referenced;
      {
        const std::lock_guard lock(mutex);
        for (const std::string& digest : rows) referenced.add(digest);
      }
      referenced.sort();
      std::this_thread::yield();
      removed += blobs.sweep(referenced, mark);
    }
  });
  std::atomic<int> lost{0};
  std::vector<std::thread> clients;
  for (unsigned seed = 0; seed < 3; ++seed) {
    clients.emplace_back([&, seed] {
      std::mt19937 random(seed);
      for (int i = 0; i < 600; ++i) {
        const std::string bytes = fmt::format("blob {}", random() % 12);
        const std::string digest = rpc::blob_digest(bytes);
        BlobStore::Hold hold(blobs);
        hold.add(digest);
        if (!blobs.contains(digest)) {
          try {
            const auto upload = blobs.begin_upload(digest, static_cast<int64_t>(bytes.size()), 0, now);
            upload->append(bytes, now);
            upload->finish(now);
          } catch (const BlobError& error) {
            // Another client sends the same.
            if (error.kind() != BlobError::Kind::Busy) ++lost;
            continue;
          }
        }
        if (!blobs.contains(digest)) ++lost;
        const bool keep = random() % 2 == 0;
        {
          const std::lock_guard lock(mutex);
          if (keep)
            rows.insert(digest);
          else
            rows.erase(digest);
          // Another client's row may have gone: what is referred to now is held by us.
        }
        if (!blobs.contains(digest)) ++lost;
      }
    });
  }
  for (std::thread& client : clients) client.join();
  done = true;
  sweeper.join();
  EXPECT_EQ(lost, 0);
  EXPECT_GT(removed, 0u) << "nothing was ever at risk";
  for (const std::string& digest : rows) EXPECT_TRUE(blobs.verify(digest)) << digest;
}

}  // namespace
}  // namespace woodcock::coordinator
