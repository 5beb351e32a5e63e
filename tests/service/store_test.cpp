#include "coordinator/store.h"

#include <gtest/gtest.h>
#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

#include "coordinator/blob_store.h"
#include "rpc/manifest.h"
#include "tests/service/coordinator_world.h"
#include "tests/service/scheduler_fixture.h"

namespace woodcock::coordinator {
namespace {

StoreOptions options(const std::string& dir) {
  return {dir, "127.0.0.1:1", [](const std::string& reason) { FAIL() << reason; }, 512};
}

ResultRecord result(char digest) { return {std::string(64, 'k'), std::string(64, digest), 10, {1, 2, 3}, {}}; }

TEST(Store, WhatWasWrittenIsThereAfterARestartAndTheTermGrows) {
  const TemporaryFolder folder;
  JobSpec spec = test_job("j1");
  spec.settings.seed = ~uint64_t{0};
  spec.rounds = {{0, 64}, {64, 96}};
  spec.target = SamplingTarget{0, 4096};
  spec.time_limit = TimeLimit{90, 1.5};
  {
    Store store(options(folder.path()));
    EXPECT_EQ(store.term(), 1u);
    EXPECT_TRUE(store.read([&](StoreSession& s) { return s.insert_job(spec); }));
    store.read([&](StoreSession& s) { return s.commit_task({"j1", 0, 3}, -1, result('d')); });
    LeaseRow lease;
    lease.lease_id = "L1-1";
    lease.task = TaskRef{"j1", 0, 4};
    lease.worker_id = "w1";
    lease.epoch = (uint64_t{7} << 32) + 1;
    store.write([lease](StoreSession& s) { s.save_lease(lease); });
    store.write([&](StoreSession& s) { s.append_event("j1", {1, 5, EventKind::Submitted, 12, "", "", "it's \"here\""}); });
  }
  Store store(options(folder.path()));
  EXPECT_EQ(store.term(), 2u);
  EXPECT_EQ(store.read([](StoreSession& s) { return s.running_jobs(); }), std::vector<std::string>{"j1"});
  Job job = store.load_job("j1").value().job;
  EXPECT_EQ(job.spec.rounds, spec.rounds);
  EXPECT_EQ(job.spec.target, spec.target);
  ASSERT_TRUE(job.spec.time_limit);
  EXPECT_EQ(job.spec.time_limit->seconds, 90);
  EXPECT_EQ(job.spec.time_limit->spent, 1.5);
  EXPECT_EQ(job.spec.settings.seed, spec.settings.seed);
  EXPECT_EQ(job.frames.at(0).spec.header, spec.frames[0].header);
  EXPECT_EQ(job.row.last_event, 1);
  store.load_tasks(job);
  EXPECT_EQ(job.frames[0].done, 1);
  EXPECT_EQ(job.frames[0].state(3), TaskState::Done);
  EXPECT_EQ(store.read([](StoreSession& s) { return s.settled({"j1", 0, 3}); }).value().result.digest, std::string(64, 'd'));
  const std::vector<LeaseRow> leases = store.read([](StoreSession& s) { return s.load_leases(); });
  ASSERT_EQ(leases.size(), 1u);
  EXPECT_EQ(leases[0].epoch, (uint64_t{7} << 32) + 1);
  const std::vector<JobEvent> events = store.read([](StoreSession& s) { return s.events("j1", 0, 10); });
  ASSERT_EQ(events.size(), 1u);
  EXPECT_EQ(events[0].message, "it's \"here\"");
  EXPECT_EQ(events[0].frame, 12u);
}

TEST(Store, ATaskCommitsOnceAndAPartOnlyIfItsParentWasSplit) {
  const TemporaryFolder folder;
  Store store(options(folder.path()));
  store.read([](StoreSession& s) { return s.insert_job(test_job("j1")); });
  const auto commit = [&](int64_t number, int64_t parent, char digest) {
    return store.read([&](StoreSession& s) { return s.commit_task({"j1", 0, number}, parent, result(digest)); });
  };
  EXPECT_TRUE(commit(0, -1, 'd'));
  EXPECT_FALSE(commit(0, -1, 'e'));
  EXPECT_FALSE(commit(16, 1, 'd'));
  SettledTask split;
  split.state = TaskState::Split;
  split.first_part = 16;
  EXPECT_TRUE(store.read([&](StoreSession& s) { return s.settle_task({"j1", 0, 1}, split); }));
  EXPECT_TRUE(commit(16, 1, 'd'));
  EXPECT_FALSE(commit(1, -1, 'd'));
}

TEST(Store, CountsOfWhatWentWrongStayWithTheResult) {
  const TemporaryFolder folder;
  ResultRecord unhealthy = result('d');
  unhealthy.health = {1, 2, 3, 4};
  {
    Store store(options(folder.path()));
    store.read([&](StoreSession& s) { return s.insert_job(test_job("j1")) && s.commit_task({"j1", 0, 3}, -1, unhealthy); });
  }
  Store store(options(folder.path()));
  EXPECT_EQ(store.read([](StoreSession& s) { return s.settled({"j1", 0, 3}); }).value().result.health, unhealthy.health);
  EXPECT_EQ(store.read([&](StoreSession& s) { return s.find_result(unhealthy.key); }).value().health, unhealthy.health);
}

TEST(Store, F24ADatabaseOfTheFirstSchemaIsUpgradedAndKeepsItsRows) {
  const TemporaryFolder folder;
  {
    Store store(options(folder.path()));
    store.read([](StoreSession& s) { return s.insert_job(test_job("j1")) && s.commit_task({"j1", 0, 3}, -1, result('d')); });
    SettledTask of_another_job;
    of_another_job.result.digest = std::string(64, 'e');
    store.read([&](StoreSession& s) { return s.settle_task({"j1", 0, 4}, of_another_job); });
  }
  {
    soci::session sql(soci::sqlite3, "db=" + (folder / "woodcock.sqlite").string());
    for (const std::string table : {"settled", "results"})
      for (const std::string column : {"nonfinite", "clamped", "majorant_violations", "truncated"})
        sql << "alter table " + table + " drop column " + column;
    for (const std::string index : {"results_unused", "jobs_ended", "frames_by_image", "frames_by_manifest"}) sql << "drop index " + index;
    sql << "alter table results drop column uses";
    sql << "alter table results drop column freed_ms";
    sql << "drop table deletions";
    sql << "drop table submissions";
    for (const std::string index : {"jobs_by_time", "jobs_running", "jobs_uncounted", "settled_not_done"}) sql << "drop index " + index;
    sql << "alter table jobs drop column summary";
    sql << "alter table frames drop column counts";
    sql << "alter table jobs drop column target";
    sql << "alter table jobs drop column quote";
    sql << "alter table jobs drop column policy";
    sql << "alter table settled drop column worker_id";
    sql << "alter table settled drop column reused";
    sql << "alter table results drop column worker_id";
    sql << "alter table frames drop column passes";
    sql << "alter table leader drop column cluster_id";
    sql << "update schema_version set version = 1";
  }
  for (int start = 0; start < 2; ++start) {
    Store store(options(folder.path()));
    EXPECT_FALSE(store.read([](StoreSession& s) { return s.find_job("j1"); }).value().spec.quote.has_value());
    const SettledTask row = store.read([](StoreSession& s) { return s.settled({"j1", 0, 3}); }).value();
    EXPECT_EQ(row.result.digest, std::string(64, 'd'));
    EXPECT_FALSE(row.result.health.any());
    EXPECT_EQ(row.result.worker_id, "");
    EXPECT_FALSE(row.reused);
    EXPECT_TRUE(store.read([](StoreSession& s) { return s.settled({"j1", 0, 4}); }).value().reused) << "such a row had no cost";
    EXPECT_EQ(store.read([](StoreSession& s) { return s.uses_of_result(result('d').key); }), 1) << "who has a result is counted";
  }
}

TEST(Store, AResultIsCountedWhoeverTakesItLosesItOrGivesItBack) {
  const TemporaryFolder folder;
  Store store(options(folder.path()));
  const std::string key = result('d').key;
  const auto uses = [&] { return store.read([&](StoreSession& s) { return s.uses_of_result(key); }); };
  const auto has = [&] { return store.read([&](StoreSession& s) { return s.find_result(key).has_value(); }); };
  JobSpec second = test_job("j2");
  store.read([&](StoreSession& s) { return s.insert_job(test_job("j1")) && s.insert_job(second); });
  EXPECT_TRUE(store.read([](StoreSession& s) { return s.commit_task({"j1", 0, 3}, -1, result('d')); }));
  EXPECT_FALSE(store.read([](StoreSession& s) { return s.commit_task({"j1", 0, 3}, -1, result('d')); }));
  EXPECT_EQ(uses(), 1);
  SettledTask reused;
  reused.result = result('d');
  reused.reused = true;
  EXPECT_TRUE(store.read([&](StoreSession& s) { return s.settle_task({"j2", 0, 3}, reused); }));
  EXPECT_FALSE(store.read([&](StoreSession& s) { return s.settle_task({"j2", 0, 3}, reused); }));
  EXPECT_EQ(uses(), 2);
  // Lost at rest: nobody is given it, the other job still has it.
  for (int i = 0; i < 2; ++i) {
    store.read([&](StoreSession& s) {
      s.reopen_task({"j2", 0, 3}, key);
      return true;
    });
    EXPECT_EQ(uses(), 1);
    EXPECT_FALSE(has());
  }
  EXPECT_TRUE(store.read([](StoreSession& s) { return s.commit_task({"j2", 0, 3}, -1, result('d')); }));
  EXPECT_EQ(uses(), 2);
  EXPECT_TRUE(has());
  // A frame that starts again leaves its result to later jobs, until it is old.
  store.read([](StoreSession& s) {
    s.reset_frame("j1", 0, 1000);
    s.reset_frame("j2", 0, 2000);
    return true;
  });
  EXPECT_EQ(uses(), 0);
  EXPECT_TRUE(has());
  EXPECT_EQ(store.read([](StoreSession& s) { return s.unused_bytes(); }), 10);
  EXPECT_EQ(store.read([](StoreSession& s) { return s.delete_unused(1999, 10); }), 0);
  EXPECT_EQ(store.read([](StoreSession& s) { return s.delete_unused(2000, 10); }), 1);
  EXPECT_FALSE(has());
}

TEST(Store, TheFolderIsOpenedOnce) {
  const TemporaryFolder folder;
  const Store store(options(folder.path()));
  EXPECT_THROW(Store(options(folder.path())), std::runtime_error);
}

TEST(Store, F24ANewerSchemaIsRefused) {
  const TemporaryFolder folder;
  { const Store store(options(folder.path())); }
  {
    soci::session sql(soci::sqlite3, "db=" + (folder / "woodcock.sqlite").string());
    sql << "update schema_version set version = 99";
  }
  EXPECT_THROW(Store(options(folder.path())), std::runtime_error);
}

TEST(Store, F17AWriteAfterTheLeadershipWasLostIsFatalAndNotMade) {
  const TemporaryFolder folder;
  std::promise<std::string> fatal;
  StoreOptions o = options(folder.path());
  o.on_fatal = [&](const std::string& reason) { fatal.set_value(reason); };
  Store store(o);
  store.barrier();
  soci::session other(soci::sqlite3, "db=" + (folder / "woodcock.sqlite timeout=5").string());
  other << "update leader set term = term + 1";
  bool done = false;
  store.write([](StoreSession& s) { s.insert_job(test_job("j1")); }, [&] { done = true; });
  EXPECT_NE(fatal.get_future().get().find("leadership"), std::string::npos);
  EXPECT_FALSE(done);
  int jobs = -1;
  other << "select count(*) from jobs", soci::into(jobs);
  EXPECT_EQ(jobs, 0);
}

TEST(BlobStore, AnUploadResumesAndAppearsOnlyWhenItsDigestIsRight) {
  const TemporaryFolder folder;
  BlobStore blobs({folder.path(), 1, kSecond}, 0);
  const std::string digest = rpc::blob_digest("hello world");
  blobs.begin_upload(digest, 11, 0, 0)->append("hello", 0);
  EXPECT_FALSE(blobs.contains(digest));
  EXPECT_EQ(blobs.upload_offset(digest), (std::pair<int64_t, bool>{5, false}));
  EXPECT_THROW(blobs.begin_upload(digest, 11, 4, 0), BlobError);
  const auto upload = blobs.begin_upload(digest, 11, 5, 0);
  EXPECT_THROW(blobs.begin_upload(digest, 11, 5, 0), BlobError) << "one upload at a time";
  EXPECT_FALSE(upload->finish(0));
  upload->append(" world", 0);
  EXPECT_TRUE(upload->finish(0));
  EXPECT_EQ(blobs.read(digest, 100), "hello world");
}

TEST(BlobStore, F06AFlippedBitIsRefusedInFlightAndFoundAtRest) {
  const TemporaryFolder folder;
  BlobStore blobs({folder.path(), 1, kSecond}, 0);
  const std::string digest = rpc::blob_digest("hello");
  {
    const auto upload = blobs.begin_upload(digest, 5, 0, 0);
    upload->append("hellp", 0);
    EXPECT_THROW(upload->finish(0), BlobError);
  }
  EXPECT_EQ(blobs.upload_offset(digest).first, 0) << "the damaged part is gone";
  put_blob(blobs, "hello");
  EXPECT_TRUE(blobs.verify(digest));
  std::ofstream(blobs.path(digest)) << "hellq";
  EXPECT_FALSE(blobs.verify(digest));
}

TEST(BlobStore, CleanUpTakesOnlyWhatIsNeitherReferencedNorPinned) {
  const TemporaryFolder folder;
  BlobStore blobs({folder.path(), 1, 10 * kSecond}, 0);
  for (const char* text : {"referenced", "pinned", "orphan"}) put_blob(blobs, text);
  const std::string partial = rpc::blob_digest("partial");
  blobs.begin_upload(partial, 7, 0, 1)->append("part", 1);
  DigestSet referenced;
  for (const char* text : {"referenced", "another"}) referenced.add(rpc::blob_digest(text));
  referenced.sort();
  EXPECT_EQ(blobs.sweep(referenced, 5 * kSecond), 0u) << "everything is pinned after a start";
  blobs.pin(rpc::blob_digest("pinned"), 8 * kSecond);
  EXPECT_EQ(blobs.sweep(referenced, 15 * kSecond), 2u);
  EXPECT_TRUE(blobs.contains(rpc::blob_digest("referenced")));
  EXPECT_TRUE(blobs.contains(rpc::blob_digest("pinned")));
  EXPECT_FALSE(blobs.contains(rpc::blob_digest("orphan")));
  EXPECT_EQ(blobs.upload_offset(partial).first, 0);
}

TEST(BlobStore, F10AFullDiskIsSaidInsteadOfFilledUp) {
  const TemporaryFolder folder;
  BlobStore blobs({folder.path(), int64_t{1} << 60, kSecond}, 0);
  EXPECT_NE(blobs.shortage(), "");
  try {
    blobs.begin_upload(rpc::blob_digest("x"), 1, 0, 0);
    FAIL();
  } catch (const BlobError& error) {
    EXPECT_EQ(error.kind(), BlobError::Kind::NoSpace);
  }
}

TEST(Manifest, F20PathsThatLeaveTheFolderAreRefused) {
  for (const char* bad : {"", "/etc/passwd", "../x", "a/../../x", "a//b", "./a", "a/.", "a\\b", "a\nb", "a/"})
    EXPECT_FALSE(rpc::is_safe_path(bad)) << bad;
  for (const char* good : {"a", "a/b.vdb", "..a/b..", "ü.png"}) EXPECT_TRUE(rpc::is_safe_path(good)) << good;
}

}  // namespace
}  // namespace woodcock::coordinator
