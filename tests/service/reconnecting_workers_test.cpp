// F14 and F16 on a coordinator in this process: workers that come and go, transfers of a byte a second, and 500 workers that come back
// at once after a restart.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <map>
#include <set>
#include <thread>
#include <vector>

#include "coordinator/server.h"
#include "rpc/blob_transfer.h"
#include "rpc/channel.h"
#include "tests/service/coordinator_world.h"

namespace woodcock::coordinator {
namespace {

using std::chrono::steady_clock;

double seconds_since(steady_clock::time_point begin) { return std::chrono::duration<double>(steady_clock::now() - begin).count(); }

/// A job of (edge / 8)² tasks.
std::string submit_many_tasks(CoordinatorWorld& world, int edge) {
  v1::SubmitJobRequest request = world.request("r1", 8);
  request.mutable_settings()->set_tile_size(8);
  FrameHeader header = world.header();
  header.width = header.height = edge;
  header.bounds = {0, 0, edge, edge};
  *request.mutable_frames(0)->mutable_header() = rpc::to_wire(header);
  return world.coordinator->submit(request).job_id();
}

std::map<v1::JobEventKind, int> count_events(CoordinatorWorld& world, const std::string& job) {
  std::map<v1::JobEventKind, int> counts;
  int64_t cursor = 0;
  for (bool more = true; more;) {
    bool finished = false;
    const v1::WatchJobResponse response = world.coordinator->watch(job, cursor, finished);
    for (const v1::JobEvent& event : response.events()) ++counts[event.kind()];
    more = response.events_size() > 0;
    if (more) cursor = response.events().rbegin()->number();
  }
  return counts;
}

class Fleet {
 public:
  Fleet(CoordinatorWorld& world, int size) : world_(world) {
    for (int i = 0; i < size; ++i) workers_.push_back({fmt::format("w{}", i), 0, 0, {}});
  }

  /// All call at once, each reports what it holds and offers one result of it; waits for all answers. Some may stay away.
  void sync(size_t from, size_t to, bool offering) {
    std::vector<std::future<std::pair<rpc::Outcome, v1::SyncResponse>>> answers;
    for (size_t i = from; i < to; ++i) {
      auto promise = std::make_shared<std::promise<std::pair<rpc::Outcome, v1::SyncResponse>>>();
      answers.push_back(promise->get_future());
      world_.coordinator->sync(request(workers_[i], offering), [promise](const rpc::Outcome& outcome, const v1::SyncResponse& response) {
        promise->set_value({outcome, response});
      });
    }
    for (size_t i = from; i < to; ++i) {
      auto& answer = answers[i - from];
      while (answer.wait_for(std::chrono::milliseconds(20)) != std::future_status::ready) world_.now += kSecond / 4;
      const auto [outcome, response] = answer.get();
      ASSERT_TRUE(outcome.ok()) << outcome.message;
      Worker& worker = workers_[i];
      cancelled += response.cancellations_size();
      for (const v1::OfferVerdict& verdict : response.verdicts()) {
        if (verdict.verdict() == v1::VERDICT_RETRY_LATER) continue;
        // A copy of a slow task may come second.
        if (verdict.verdict() != v1::VERDICT_REFUSED) committed.insert(worker.held[verdict.lease_id()].task().task_id());
        worker.held.erase(verdict.lease_id());
      }
      for (const v1::LeaseCancellation& lease : response.cancellations()) worker.held.erase(lease.lease_id());
      for (const v1::LeaseGrant& grant : response.grants()) worker.held[grant.lease_id()] = grant;
    }
  }

  size_t size() const { return workers_.size(); }
  size_t held(size_t from, size_t to) const {
    size_t sum = 0;
    for (size_t i = from; i < to; ++i) sum += workers_[i].held.size();
    return sum;
  }

  int cancelled = 0;
  std::set<std::string> committed;

 private:
  struct Worker {
    std::string id;
    uint64_t sequence = 0, counter = 0;
    std::map<std::string, v1::LeaseGrant> held;
  };

  v1::SyncRequest request(Worker& worker, bool offering) {
    v1::SyncRequest request = world_.sync_request(worker.id);
    request.set_incarnation(1);
    request.set_sequence(++worker.sequence);
    for (const auto& [id, grant] : worker.held) {
      if (offering && request.offers().empty()) {
        const std::string tile = CoordinatorWorld::tile_bytes(grant.task());
        put_blob(world_.coordinator->blobs(), tile);
        add_offer(request, grant, tile);
        continue;
      }
      v1::LeaseReport* lease = request.add_leases();
      lease->set_lease_id(id);
      lease->set_task_id(grant.task().task_id());
      lease->set_epoch(grant.epoch());
      lease->set_renewal_counter(++worker.counter);
      lease->set_phase(v1::LEASE_PHASE_RENDERING);
    }
    return request;
  }

  CoordinatorWorld& world_;
  std::vector<Worker> workers_;
};

TEST(ReconnectingWorkers, F16_FiveHundredComeBackAfterARestartAndNoLeaseExpiresFalsely) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = submit_many_tasks(world, 320);
  Fleet fleet(world, 500);
  for (int round = 0; round < 10 && fleet.held(0, 500) < 1000; ++round) fleet.sync(0, 500, false);
  ASSERT_EQ(fleet.held(0, 500), 1000u) << "one that is rendered and one that waits, each";

  // The coordinator is away for as long as several leases; then most workers come back at once, some just within a lease and its
  // grace, and ten never.
  world.stop();
  world.now += 300 * kSecond;
  world.start();
  fleet.sync(0, 400, false);
  world.now += 30 * kSecond;
  fleet.sync(400, 490, false);
  fleet.sync(0, 400, false);
  EXPECT_EQ(fleet.cancelled, 0);
  EXPECT_EQ(count_events(world, id)[v1::JOB_EVENT_KIND_LEASE_EXPIRED], 0);

  // Those that are gone lose theirs, and only those.
  for (int i = 0; i < 3; ++i) {
    world.now += 10 * kSecond;
    fleet.sync(0, 490, false);
  }
  std::map<v1::JobEventKind, int> events;
  for (int i = 0; i < 100 && events[v1::JOB_EVENT_KIND_LEASE_EXPIRED] < 20; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    events = count_events(world, id);
  }
  EXPECT_EQ(events[v1::JOB_EVENT_KIND_LEASE_EXPIRED], 20);
  EXPECT_EQ(fleet.cancelled, 0);
  EXPECT_EQ(fleet.held(0, 490), 980u) << "all that they held they hold still, and their slots are full";

  for (int round = 0; round < 60 && fleet.committed.size() < 1600; ++round) fleet.sync(0, 490, true);
  EXPECT_EQ(fleet.committed.size(), 1600u);
  const v1::Job job = world.wait_until_ended(id);
  EXPECT_EQ(job.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(job.progress().samples_done(), 320 * 320 * 8);
  EXPECT_EQ(job.progress().tasks_leased(), 0);
}

TEST(ReconnectingWorkers, AThousandThatRenderCallAsOftenAsOneCoordinatorAnswersAndNoLeaseExpires) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = submit_many_tasks(world, 400);
  constexpr size_t kWorkers = 1000;
  Fleet fleet(world, kWorkers);
  for (int round = 0; round < 20 && fleet.held(0, kWorkers) < 2 * kWorkers; ++round) fleet.sync(0, kWorkers, false);
  ASSERT_EQ(fleet.held(0, kWorkers), 2 * kWorkers);
  // Each calls again as soon as it is answered: how often that is, the coordinator decides.
  constexpr int kCalls = 30;
  const Time begin = world.now;
  for (int call = 0; call < kCalls; ++call) fleet.sync(0, kWorkers, false);
  const double seconds = static_cast<double>(world.now - begin) / static_cast<double>(kSecond);
  EXPECT_GT(seconds, 100) << "several leases long";
  EXPECT_LT(static_cast<double>(kCalls * kWorkers) / seconds, 300) << "calls a second";
  EXPECT_EQ(fleet.cancelled, 0);
  EXPECT_EQ(count_events(world, id)[v1::JOB_EVENT_KIND_LEASE_EXPIRED], 0);
  EXPECT_EQ(fleet.held(0, kWorkers), 2 * kWorkers);
}

TEST(ReconnectingWorkers, F14_AWorkerThatComesAndGoesCostsOthersNothing) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  const std::string id = submit_many_tasks(world, 160);
  int committed = 0;
  uint64_t incarnation = 0, taken = 0;
  const auto flap = [&] {
    // It is started, takes what it gets, and is gone before it has reported anything.
    v1::SyncRequest request = world.sync_request("flapping");
    request.set_incarnation(++incarnation);
    request.set_sequence(1);
    taken += static_cast<uint64_t>(world.sync(request).second.grants_size());
  };
  committed += world.work("steady", 1);
  for (int i = 0; i < 100; ++i) {
    flap();
    // Another one hangs up in the middle of a call.
    const uint64_t call = world.coordinator->sync(world.sync_request("hangs-up"), [](const rpc::Outcome&, const v1::SyncResponse&) {});
    world.coordinator->cancel_sync(call);
  }
  EXPECT_GE(taken, 100u) << "the fault did not fire";
  const v1::Job middle = world.coordinator->job(id);
  EXPECT_LE(middle.progress().tasks_leased(), 2 * 3) << "what it had taken before was given back";
  world.now += 60 * kSecond;
  committed += world.work("steady", 2000);
  const v1::Job job = world.wait_until_ended(id);
  EXPECT_EQ(job.state(), v1::JOB_STATE_DONE);
  EXPECT_EQ(committed, 400);
  EXPECT_EQ(job.progress().tasks_total(), 400) << "no task was split on its account";
  EXPECT_EQ(job.progress().tasks_leased(), 0);
}

TEST(ReconnectingWorkers, F14_UploadsOfAByteASecondHoldNobodyUpAndGoOnWhereTheyWere) {
  const TemporaryFolder folder;
  CoordinatorWorld world(folder.path());
  CoordinatorServer server(*world.coordinator, "127.0.0.1:0");
  constexpr int kSlow = 40, kSeconds = 5;
  const auto content = [](int i) { return "a slow upload, number " + std::to_string(i); };
  std::atomic<int> sent{0};
  std::vector<std::thread> slow;
  for (int i = 0; i < kSlow; ++i)
    slow.emplace_back([&, i] {
      const auto blobs = v1::BlobsService::NewStub(rpc::make_channel(server.address()));
      grpc::ClientContext context;
      rpc::set_deadline(context, std::chrono::seconds(60));
      v1::UploadResponse response;
      const auto writer = blobs->Upload(&context, &response);
      v1::UploadRequest request;
      request.mutable_header()->set_content_digest(rpc::blob_digest(content(i)));
      request.mutable_header()->set_total_bytes(static_cast<int64_t>(content(i).size()));
      if (!writer->Write(request)) return;
      for (int second = 0; second < kSeconds; ++second) {
        request.set_chunk(content(i).substr(static_cast<size_t>(second), 1));
        if (!writer->Write(request)) return;
        ++sent;
        std::this_thread::sleep_for(std::chrono::seconds(1));
      }
      context.TryCancel();
    });
  while (sent < kSlow) std::this_thread::sleep_for(std::chrono::milliseconds(10));

  // Meanwhile a job is rendered, and others send what they have.
  const auto channel = rpc::make_channel(server.address());
  const auto blobs = v1::BlobsService::NewStub(channel);
  const auto jobs = v1::JobsService::NewStub(channel);
  double longest = 0;
  const auto timed = [&](auto call) {
    const auto begin = steady_clock::now();
    call();
    longest = std::max(longest, seconds_since(begin));
  };
  const std::string id = world.coordinator->submit(world.request("r1", 8)).job_id();
  timed([&] { EXPECT_EQ(rpc::upload_bytes(*blobs, std::string(3'000'000, 'x')), rpc::blob_digest(std::string(3'000'000, 'x'))); });
  timed([&] { EXPECT_EQ(world.work("w1"), 4); });
  for (int i = 0; i < 20; ++i)
    timed([&] {
      grpc::ClientContext context;
      rpc::set_deadline(context, std::chrono::seconds(20));
      v1::ListJobsResponse response;
      EXPECT_TRUE(jobs->ListJobs(&context, {}, &response).ok());
    });
  EXPECT_LT(sent, kSlow * kSeconds) << "the slow ones had ended before";
  EXPECT_LT(longest, 3) << "a busy machine may need tenths of a second";
  for (std::thread& one : slow) one.join();

  // Cut in the middle, they go on from their last byte.
  for (int i = 0; i < kSlow; ++i) {
    const std::string digest = rpc::blob_digest(content(i));
    int64_t offset = 0;
    for (int wait = 0; wait < 200 && offset < kSeconds; ++wait) {
      offset = world.coordinator->blobs().upload_offset(digest).first;
      if (offset < kSeconds) std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    EXPECT_EQ(offset, kSeconds);
    EXPECT_EQ(rpc::upload_bytes(*blobs, content(i)), digest);
    EXPECT_EQ(world.coordinator->blobs().read(digest, 100), content(i));
  }
}

}  // namespace
}  // namespace woodcock::coordinator
