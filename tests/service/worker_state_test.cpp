// The worker's logic without threads, network or clock: lease book, spool, scene store, folder.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "rpc/error.h"
#include "rpc/manifest.h"
#include "tests/support/temporary_folder.h"
#include "worker/lease_book.h"
#include "worker/scene_store.h"
#include "worker/spool.h"
#include "worker/worker_folder.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;
using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;
using ::testing::SizeIs;

class WorkerStateTest : public ::testing::Test {
 protected:
  static void write(const fs::path& path, const std::string& text) { std::ofstream(path) << text; }
  static std::string read(const fs::path& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  const testing::TemporaryFolder temporary_;
  const fs::path folder_ = temporary_.path();
};

std::string key(char digit) { return std::string(64, digit); }

v1::LeaseGrant grant(const std::string& id, char task_key, int64_t duration_ms = 3000) {
  v1::LeaseGrant grant;
  grant.set_lease_id(id);
  grant.set_epoch(7);
  grant.set_duration_ms(duration_ms);
  grant.mutable_task()->set_task_id("job.0." + id);
  grant.mutable_task()->set_result_key(key(task_key));
  grant.mutable_task()->set_manifest_digest(key('f'));
  return grant;
}

class LeaseBookTest : public WorkerStateTest {
 protected:
  /// One exchange at `now` whose answer is `response`; returns the request.
  v1::SyncRequest sync(const v1::SyncResponse& response = {}) {
    v1::SyncRequest request;
    book_.fill(request, now_);
    book_.apply(request, now_, response, now_);
    return request;
  }
  void give(const v1::LeaseGrant& lease) {
    v1::SyncResponse response;
    *response.add_grants() = lease;
    sync(response);
  }
  v1::SyncResponse answer(const v1::SyncRequest& request, v1::Verdict verdict) {
    v1::SyncResponse response;
    for (const v1::ResultOffer& offer : request.offers()) {
      v1::OfferVerdict& v = *response.add_verdicts();
      v.set_result_key(offer.result_key());
      v.set_result_digest(offer.result_digest());
      v.set_verdict(verdict);
    }
    return response;
  }
  /// Takes the lease through fetching and rendering into the spool.
  void finish(const std::string& lease_id, char task_key) {
    book_.next_to_fetch();
    book_.fetched(lease_id);
    const auto lease = book_.next_to_render();
    ASSERT_TRUE(lease.has_value());
    write(spool_.tile_path(key(task_key)), "tile");
    RenderedTile tile;
    tile.result_key = key(task_key);
    tile.digest = key('d');
    tile.bytes = 4;
    tile.nonfinite = 1, tile.clamped = 2, tile.majorant_violations = 3, tile.truncated = 4;
    book_.rendered(*lease, tile);
  }

  Spool spool_{folder_ / "spool"};
  LeaseBook book_{spool_};
  BootTime now_ = seconds(1000);
};

TEST_F(LeaseBookTest, AnOfferSaysWhatWentWrong) {
  give(grant("a", '1'));
  finish("a", '1');
  book_.next_to_upload(now_);
  book_.uploaded(key('1'));
  const v1::SyncRequest request = sync();
  ASSERT_THAT(request.offers(), SizeIs(1));
  const v1::HealthCounts& health = request.offers(0).cost().health();
  EXPECT_EQ(health.nonfinite_samples(), 1);
  EXPECT_EQ(health.clamped_samples(), 2);
  EXPECT_EQ(health.majorant_violations(), 3);
  EXPECT_EQ(health.truncated_paths(), 4);
}

TEST_F(LeaseBookTest, LeaseGoesThroughItsPhases) {
  give(grant("a", '1'));
  EXPECT_EQ(sync().leases(0).phase(), v1::LEASE_PHASE_QUEUED);
  ASSERT_EQ(book_.next_to_fetch()->lease_id(), "a");
  EXPECT_FALSE(book_.next_to_fetch().has_value());
  EXPECT_EQ(sync().leases(0).phase(), v1::LEASE_PHASE_FETCHING);
  EXPECT_FALSE(book_.next_to_render().has_value());
  book_.fetched("a");
  ASSERT_EQ(book_.next_to_render()->lease_id(), "a");
  EXPECT_EQ(sync().leases(0).phase(), v1::LEASE_PHASE_LOADING);
  book_.progressed("a", {"rendering", 10, 20});
  const auto report = sync().leases(0);
  EXPECT_EQ(report.phase(), v1::LEASE_PHASE_RENDERING);
  EXPECT_EQ(report.samples_done(), 10);
}

TEST_F(LeaseBookTest, F08_HeartbeatsNeverRenewATaskThatMakesNoProgress) {
  give(grant("a", '1'));
  book_.next_to_fetch();
  book_.fetched("a");
  book_.next_to_render();
  sync();
  const uint64_t counter = sync().leases(0).renewal_counter();
  for (int i = 0; i < 5; ++i) EXPECT_EQ(sync().leases(0).renewal_counter(), counter);
  now_ += milliseconds(2999);
  sync();
  EXPECT_FALSE(book_.should_stop("a", now_));
  now_ += milliseconds(1);
  EXPECT_TRUE(book_.should_stop("a", now_)) << "answered calls without a moving counter do not move the deadline";
}

TEST_F(LeaseBookTest, ProgressThatTheCoordinatorHeardOfMovesTheDeadline) {
  give(grant("a", '1'));
  book_.next_to_fetch();
  book_.fetched("a");
  book_.next_to_render();
  for (int i = 1; i < 10; ++i) {
    now_ += milliseconds(2000);
    book_.progressed("a", {"rendering", static_cast<uint64_t>(i), 0});
    sync();
    EXPECT_FALSE(book_.should_stop("a", now_));
  }
}

TEST_F(LeaseBookTest, F13_WithoutAnAnswerWorkStopsAtTheLeasesOwnDeadline) {
  give(grant("a", '1'));
  give(grant("b", '2'));
  book_.next_to_fetch();
  book_.fetched("a");
  book_.next_to_render();
  now_ += milliseconds(3000);
  book_.progressed("a", {"rendering", 5, 5});
  EXPECT_THAT(book_.expire(now_), SizeIs(2));
  EXPECT_TRUE(book_.should_stop("a", now_));
  EXPECT_FALSE(book_.next_to_fetch().has_value()) << "a waiting lease is gone";
}

TEST_F(LeaseBookTest, F13_ResultStaysInTheSpoolUntilItIsAcknowledged) {
  give(grant("a", '1'));
  finish("a", '1');
  ASSERT_EQ(book_.next_to_upload(now_)->result_key(), key('1'));
  EXPECT_THAT(sync().offers(), SizeIs(0)) << "not before it is uploaded";
  book_.uploaded(key('1'));
  EXPECT_THAT(sync().offers(), SizeIs(1));
  now_ += seconds(100);
  book_.expire(now_);
  const auto request = sync();
  ASSERT_THAT(request.offers(), SizeIs(1)) << "the lease is gone, the result is not";
  EXPECT_THAT(request.leases(), SizeIs(0));
  sync(answer(request, v1::VERDICT_COMMITTED));
  EXPECT_THAT(sync().offers(), SizeIs(0));
  EXPECT_FALSE(fs::exists(spool_.tile_path(key('1'))));
  EXPECT_TRUE(book_.idle());
}

TEST_F(LeaseBookTest, ResultIsOfferedAgainAfterARestart) {
  give(grant("a", '1'));
  finish("a", '1');
  write(folder_ / "spool" / (key('2') + ".exr"), "a tile without its offer");
  write(folder_ / "spool" / ".half.tmp", "half");
  Spool spool(folder_ / "spool");
  LeaseBook book(spool);
  v1::SyncRequest request;
  book.fill(request, now_);
  ASSERT_THAT(request.offers(), SizeIs(1));
  EXPECT_EQ(request.offers(0).result_key(), key('1'));
  EXPECT_EQ(request.offers(0).epoch(), 7u);
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "spool"), {}), 2) << "what is unfinished is removed";
}

TEST_F(LeaseBookTest, VerdictsDecideWhatHappensToAResult) {
  give(grant("a", '1'));
  finish("a", '1');
  book_.next_to_upload(now_);
  book_.uploaded(key('1'));
  sync(answer(sync(), v1::VERDICT_RETRY_LATER));
  EXPECT_THAT(sync().offers(), SizeIs(0));
  now_ += seconds(4);
  sync(answer(sync(), v1::VERDICT_UPLOAD_NEEDED));
  ASSERT_TRUE(book_.next_to_upload(now_).has_value());
  book_.upload_failed(key('1'), now_ + seconds(2));
  EXPECT_FALSE(book_.next_to_upload(now_).has_value());
  now_ += seconds(2);
  ASSERT_TRUE(book_.next_to_upload(now_).has_value());
  book_.uploaded(key('1'));
  sync(answer(sync(), v1::VERDICT_REFUSED));
  EXPECT_TRUE(book_.idle());
}

TEST_F(LeaseBookTest, GrantOfATaskThatIsInTheSpoolIsNotRenderedAgain) {
  give(grant("a", '1'));
  finish("a", '1');
  book_.next_to_upload(now_);
  book_.uploaded(key('1'));
  now_ += seconds(100);
  book_.expire(now_);
  give(grant("b", '1'));
  EXPECT_FALSE(book_.next_to_fetch().has_value());
  const auto request = sync();
  ASSERT_THAT(request.offers(), SizeIs(1));
  EXPECT_EQ(request.offers(0).lease_id(), "b");
}

// Two jobs may ask for one result. An offer may be under way when the second lease comes.
TEST_F(LeaseBookTest, LeasesOfOneResultEachGetAVerdict) {
  for (const v1::Verdict verdict : {v1::VERDICT_COMMITTED, v1::VERDICT_ALREADY_COMMITTED, v1::VERDICT_REFUSED}) {
    give(grant("a", '1'));
    finish("a", '1');
    book_.next_to_upload(now_);
    book_.uploaded(key('1'));
    v1::SyncRequest request = sync();
    v1::SyncResponse response = answer(request, verdict);
    *response.add_grants() = grant("b", '1');
    *response.add_grants() = grant("c", '1');
    give(grant("b", '1'));
    book_.apply(request, now_, response, now_);
    for (const char* lease : {"b", "c"}) {
      request = sync();
      ASSERT_THAT(request.offers(), SizeIs(1)) << lease;
      EXPECT_EQ(request.offers(0).lease_id(), lease);
      response = answer(request, verdict);
      book_.apply(request, now_, response, now_);
    }
    EXPECT_TRUE(book_.idle());
    EXPECT_FALSE(fs::exists(spool_.tile_path(key('1'))));
  }
}

TEST_F(LeaseBookTest, CancelledLeaseStopsAndItsFailureIsNotReported) {
  give(grant("a", '1'));
  book_.next_to_fetch();
  book_.fetched("a");
  const auto lease = book_.next_to_render();
  v1::SyncResponse response;
  response.add_cancellations()->set_lease_id("a");
  sync(response);
  EXPECT_TRUE(book_.should_stop("a", now_));
  book_.failed(*lease, {FailureCause::kCrash, "killed"}, "");
  EXPECT_TRUE(book_.idle());
}

TEST_F(LeaseBookTest, FailureIsReportedUntilTheCoordinatorHeardIt) {
  give(grant("a", '1'));
  book_.next_to_fetch();
  book_.fetched("a");
  const auto lease = book_.next_to_render();
  const uint64_t before = book_.news();
  book_.failed(*lease, {FailureCause::kHang, "no progress \xff"}, std::string(20000, 'x'));
  EXPECT_GT(book_.news(), before);
  v1::SyncRequest lost;
  book_.fill(lost, now_);
  ASSERT_THAT(lost.failures(), SizeIs(1));
  EXPECT_EQ(lost.failures(0).cause(), v1::FAILURE_CAUSE_HANG);
  EXPECT_EQ(lost.failures(0).message(), "no progress \\xff");
  EXPECT_LE(lost.failures(0).log_excerpt().size(), 16u << 10);
  EXPECT_THAT(sync().failures(), SizeIs(1)) << "the first call got no answer";
  EXPECT_THAT(sync().failures(), SizeIs(0));
}

TEST_F(LeaseBookTest, DrainingGivesBackWhatHasNotBegunAndTakesNothingNew) {
  give(grant("a", '1'));
  give(grant("b", '2'));
  book_.next_to_fetch();
  book_.fetched("a");
  const auto running = book_.next_to_render();
  book_.drain();
  auto request = sync();
  ASSERT_THAT(request.releases(), SizeIs(1));
  EXPECT_EQ(request.releases(0).lease_id(), "b");
  give(grant("c", '3'));
  EXPECT_EQ(sync().releases(0).lease_id(), "c");
  EXPECT_FALSE(book_.should_stop("a", now_)) << "what runs may finish";
  book_.stop_rendering();
  EXPECT_TRUE(book_.should_stop("a", now_));
  book_.stopped(*running);
  EXPECT_EQ(sync().releases(0).lease_id(), "a");
  EXPECT_TRUE(book_.idle());
}

TEST_F(LeaseBookTest, MalformedGrantIsAFailureNotACrash) {
  v1::LeaseGrant bad = grant("a", '1');
  bad.mutable_task()->set_task_id("../../etc");
  give(bad);
  const auto request = sync();
  ASSERT_THAT(request.failures(), SizeIs(1));
  EXPECT_FALSE(book_.next_to_fetch().has_value());
}

// --- scenes ------------------------------------------------------------------------------------------------------

class SceneStoreTest : public WorkerStateTest {
 protected:
  /// Makes a scene of these files known to the source; returns its manifest's digest.
  std::string add_scene(const std::vector<std::pair<std::string, std::string>>& files) {
    v1::SceneManifest manifest;
    for (const auto& [path, content] : files) {
      v1::SceneFile& file = *manifest.add_files();
      file.set_path(path);
      file.set_content_digest(rpc::blob_digest(content));
      file.set_bytes(static_cast<int64_t>(content.size()));
      blobs_[file.content_digest()] = content;
    }
    const std::string bytes = rpc::serialize_manifest(manifest);
    const std::string digest = rpc::blob_digest(bytes);
    blobs_[digest] = bytes;
    return digest;
  }
  BlobSource source() {
    return {[this](const std::string& digest) { return blobs_.at(digest); },
            [this](const std::string& digest, const std::string& path) { ++fetched_, write(path, blobs_.at(digest)); }};
  }
  std::map<std::string, std::string> blobs_;
  int fetched_ = 0;
};

TEST_F(SceneStoreTest, LaysASceneOutUnderItsOwnNamesAndFetchesSharedFilesOnce) {
  SceneStore store(folder_, 1 << 20);
  const std::string one = add_scene({{"a.pbrt", "scene one"}, {"data/cloud.nvdb", "volume"}});
  const std::string two = add_scene({{"b.pbrt", "scene two"}, {"other/place.nvdb", "volume"}});
  const fs::path first = store.prepare(one, source()), second = store.prepare(two, source());
  EXPECT_EQ(read(first / "a.pbrt"), "scene one");
  EXPECT_EQ(read(first / "data/cloud.nvdb"), "volume");
  EXPECT_EQ(read(second / "other/place.nvdb"), "volume");
  EXPECT_EQ(fetched_, 3);
  store.prepare(one, source());
  SceneStore(folder_, 1 << 20).prepare(two, source());
  EXPECT_EQ(fetched_, 3) << "kept over a restart";
}

TEST_F(SceneStoreTest, F20_PathsThatLeaveTheFolderAreRefused) {
  SceneStore store(folder_ / "store", 1 << 20);
  for (const char* path : {"../evil.pbrt", "/etc/evil.pbrt", "a/../../evil.pbrt", "a//b", ".", "a\\b", ""})
    EXPECT_THROW(store.prepare(add_scene({{path, "x"}}), source()), rpc::RpcError) << path;
  EXPECT_EQ(fetched_, 0);
  EXPECT_FALSE(fs::exists(folder_ / "evil.pbrt"));
}

TEST_F(SceneStoreTest, LeastRecentlyUsedSceneGoesFirstAndThoseInUseStay) {
  SceneStore store(folder_, 2500);
  const std::string one = add_scene({{"a.pbrt", std::string(1000, '1')}});
  const std::string two = add_scene({{"b.pbrt", std::string(1000, '2')}});
  const std::string three = add_scene({{"c.pbrt", std::string(1000, '3')}});
  const auto age = [&](const std::string& digest, int hours) {
    fs::last_write_time(folder_ / "scenes" / digest, fs::file_time_type::clock::now() - std::chrono::hours(hours));
  };
  store.prepare(one, source()), store.prepare(two, source()), store.prepare(three, source());
  age(one, 3), age(two, 2), age(three, 1);
  store.trim({one});
  EXPECT_TRUE(fs::exists(folder_ / "scenes" / one)) << "in use";
  EXPECT_FALSE(fs::exists(folder_ / "scenes" / two));
  EXPECT_TRUE(fs::exists(folder_ / "scenes" / three));
  EXPECT_LE(store.blob_bytes(), 2500u);
}

TEST_F(SceneStoreTest, DiscardedSceneIsFetchedAgain) {
  SceneStore store(folder_, 1 << 20);
  const std::string one = add_scene({{"a.pbrt", "scene one"}});
  store.prepare(one, source());
  store.discard(one);
  store.prepare(one, source());
  EXPECT_EQ(fetched_, 2);
}

// --- folder ------------------------------------------------------------------------------------------------------

class WorkerFolderTest : public WorkerStateTest {};

TEST_F(WorkerFolderTest, IdStaysAndIncarnationGrows) {
  std::string id;
  for (uint64_t start = 1; start <= 3; ++start) {
    const WorkerFolder folder(folder_ / "w");
    if (start == 1) id = folder.worker_id();
    EXPECT_EQ(folder.worker_id(), id);
    EXPECT_EQ(folder.incarnation(), start);
  }
}

TEST_F(WorkerFolderTest, TwoWorkersCannotShareAFolder) {
  const WorkerFolder folder(folder_ / "w");
  try {
    const WorkerFolder second(folder_ / "w");
    FAIL() << "the second was let in";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("another worker runs in"));
  }
}

}  // namespace
}  // namespace woodcock
