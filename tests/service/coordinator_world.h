// A coordinator in this process: its folder, a clock that is told, tiles made without rendering.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <future>
#include <iterator>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "coordinator/coordinator.h"
#include "renderer/accuracy/error_summary.h"
#include "renderer/film/dyadic.h"
#include "renderer/film/exr.h"
#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/manifest.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::coordinator {

using testing::TemporaryFolder;

inline void put_blob(BlobStore& blobs, const std::string& bytes) {
  const auto upload = blobs.begin_upload(rpc::blob_digest(bytes), static_cast<int64_t>(bytes.size()), 0, 1);
  upload->append(bytes, 1);
  ASSERT_TRUE(upload->finish(1));
}

/// Adds to a worker's call the offer of what it rendered for a lease. No cost.
inline v1::ResultOffer& add_offer(v1::SyncRequest& request, const v1::LeaseGrant& grant, const std::string& tile) {
  v1::ResultOffer& offer = *request.add_offers();
  offer.set_lease_id(grant.lease_id());
  offer.set_task_id(grant.task().task_id());
  offer.set_epoch(grant.epoch());
  offer.set_result_key(grant.task().result_key());
  offer.set_result_digest(rpc::blob_digest(tile));
  offer.set_bytes(static_cast<int64_t>(tile.size()));
  return offer;
}

class CoordinatorWorld {
 public:
  explicit CoordinatorWorld(const std::string& dir, std::function<void(CoordinatorOptions&)> adjust = {})
      : dir_(dir), adjust_(std::move(adjust)) {
    start();
  }

  void start() {
    CoordinatorOptions options;
    options.dir = dir_;
    options.now = [this] { return now.load(); };
    options.unix_ms = [] { return int64_t{1'700'000'000'000}; };
    options.on_fatal = [](const std::string& reason) {
      ADD_FAILURE() << reason;
      abort();
    };
    options.min_free_bytes = 1;
    if (adjust_) adjust_(options);
    coordinator = std::make_unique<Coordinator>(options);
  }
  void stop() { coordinator.reset(); }

  FrameHeader header() const {
    FrameHeader h;
    h.scene_digest = std::string(64, 'a');
    h.settings_digest = std::string(64, 'b');
    h.width = h.height = 32;
    h.bounds = {0, 0, 32, 32};
    h.settings = {{"estimator", "auto"}};
    return h;
  }

  v1::SubmitJobRequest request(const std::string& id, int64_t samples = 8) {
    v1::SceneManifest manifest;
    v1::SceneFile* file = manifest.add_files();
    file->set_path("scene.pbrt");
    file->set_content_digest(rpc::blob_digest("scene"));
    file->set_bytes(5);
    put_blob(coordinator->blobs(), "scene");
    put_blob(coordinator->blobs(), rpc::serialize_manifest(manifest));
    v1::SubmitJobRequest r;
    r.set_request_id(id);
    r.set_name("test");
    r.mutable_settings()->set_samples(samples);
    r.mutable_settings()->set_tile_size(16);
    v1::FrameInput* frame = r.add_frames();
    frame->set_manifest_digest(rpc::blob_digest(rpc::serialize_manifest(manifest)));
    frame->set_scene_file("scene.pbrt");
    *frame->mutable_header() = rpc::to_wire(header());
    return r;
  }

  /// The tile of a task, every sample of which is its index + 1.
  static std::string tile_bytes(const v1::TaskSpec& task) {
    const FrameHeader header = rpc::from_wire(task.header());
    Tile tile{rpc::from_wire(task.rect(), "rect"), rpc::from_wire(task.range(), "range"), {}};
    PixelAccumulator pixel(tile.range);
    while (!pixel.complete()) {
      const int64_t i = pixel.next_index();
      pixel.push(leaf(Rgb(static_cast<float>(i + 1)), {}, i));
    }
    tile.pixels.assign(static_cast<size_t>(tile.rect.area()), pixel.result());
    return encode_exr(header, std::span<const Tile>(&tile, 1));
  }

  v1::SyncRequest sync_request(const std::string& worker) {
    v1::SyncRequest r;
    *r.mutable_protocol() = rpc::this_protocol();
    r.set_worker_id(worker);
    r.set_incarnation(incarnation);
    r.set_sequence(++sequence);
    r.set_build(build);
    r.set_arithmetic_class("class");
    r.set_slots(1);
    r.set_threads(1);
    r.set_state(v1::WORKER_STATE_READY);
    for (const std::string& tag : tags) r.add_tags(tag);
    r.set_memory_bytes(memory);
    return r;
  }

  /// Waits for the answer; the told clock runs on, so that a held call comes back.
  std::pair<rpc::Outcome, v1::SyncResponse> sync(const v1::SyncRequest& request) {
    std::promise<std::pair<rpc::Outcome, v1::SyncResponse>> promise;
    auto future = promise.get_future();
    coordinator->sync(request, [&](const rpc::Outcome& outcome, const v1::SyncResponse& response) {
      promise.set_value({outcome, response});
    });
    while (future.wait_for(std::chrono::milliseconds(50)) != std::future_status::ready) now += kSecond;
    return future.get();
  }

  /// Renders for `worker` until nothing is granted any more. Returns how many tiles were committed.
  int work(const std::string& worker, int limit = 1000) {
    std::map<std::string, v1::LeaseGrant> held;
    std::set<std::string> retried;
    int committed = 0;
    uint64_t counter = 0;
    for (int idle = 0; idle < 2 && committed < limit;) {
      v1::SyncRequest request = sync_request(worker);
      std::string offered;
      for (const auto& [id, grant] : held) {
        if (offered.empty()) {
          const std::string tile = tile_bytes(grant.task());
          put_blob(coordinator->blobs(), tile);
          v1::ResultOffer& offer = add_offer(request, grant, tile);
          offer.mutable_cost()->set_cpu_ns(kTaskCpu);
          offer.mutable_cost()->set_wall_ns(kTaskWall);
          offered = id;
        } else {
          v1::LeaseReport* lease = request.add_leases();
          lease->set_lease_id(id);
          lease->set_task_id(grant.task().task_id());
          lease->set_epoch(grant.epoch());
          lease->set_renewal_counter(++counter);
          lease->set_phase(v1::LEASE_PHASE_RENDERING);
        }
      }
      const auto [outcome, response] = sync(request);
      EXPECT_TRUE(outcome.ok()) << outcome.message;
      for (const v1::OfferVerdict& verdict : response.verdicts()) {
        // The told clock may run past the store's deadline on a busy machine: a worker offers the result again then.
        if (verdict.verdict() == v1::VERDICT_RETRY_LATER) {
          retried.insert(verdict.lease_id());
          continue;
        }
        if (!retried.contains(verdict.lease_id()) || verdict.verdict() != v1::VERDICT_ALREADY_COMMITTED) {
          EXPECT_EQ(verdict.verdict(), v1::VERDICT_COMMITTED) << verdict.reason();
        }
        held.erase(verdict.lease_id());
        ++committed;
      }
      for (const v1::LeaseGrant& grant : response.grants()) {
        // A lease that ended while it was told again gives way to the one that its task has now.
        std::erase_if(held, [&](const auto& other) { return other.second.task().task_id() == grant.task().task_id(); });
        held[grant.lease_id()] = grant;
      }
      idle = held.empty() ? idle + 1 : 0;
    }
    return committed;
  }

  v1::Job wait_until_ended(const std::string& id) {
    for (int i = 0; i < 7500; ++i) {  // 150 s; of merges that a sanitizer slows down, some tests have hundreds
      const v1::Job job = coordinator->job(id);
      if (job.state() >= v1::JOB_STATE_DONE) return job;
      now += kSecond;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ADD_FAILURE() << "the job does not end";
    return {};
  }

  static constexpr int64_t kTaskCpu = 30'000'000, kTaskWall = 40'000'000;  ///< what each task costs, ns
  std::atomic<Time> now{1000 * kSecond};
  uint64_t sequence = 0, incarnation = 1;
  std::string build = "build";  ///< of workers
  std::vector<std::string> tags;
  int64_t memory = 0;
  std::unique_ptr<Coordinator> coordinator;

 private:
  std::string dir_;
  std::function<void(CoordinatorOptions&)> adjust_;
};

/// The frame in one go: what any split of the work must give.
inline std::string whole_frame(const CoordinatorWorld& world, int64_t samples) {
  FrameHeader header = world.header();
  header.build = world.build;
  header.arithmetic_class = "class";
  std::vector<Tile> nodes;
  for (const SampleRange range : dyadic_nodes({0, samples})) {
    v1::TaskSpec task;
    *task.mutable_header() = rpc::to_wire(header);
    *task.mutable_rect() = rpc::to_wire(header.bounds);
    *task.mutable_range() = rpc::to_wire(range);
    nodes.push_back(decode_exr(CoordinatorWorld::tile_bytes(task), "node").nodes.at(0));
  }
  const TemporaryFolder folder;
  write_exr((folder / "frame.exr").string(), header, nodes, &kErrorSummary);
  std::ifstream in((folder / "frame.exr").string(), std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

inline std::string image_of(CoordinatorWorld& world, const std::string& job) {
  return world.coordinator->blobs().read(world.coordinator->frame(job, 0, false).image_digest(), 1 << 20);
}

}  // namespace woodcock::coordinator
