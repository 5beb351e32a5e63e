// A farm in fast motion: small jobs by the thousand, rendered, merged, and let go by their age, within minutes.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "tests/service/retention_world.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::coordinator {

struct FastMotion {
  double seconds = 0;
  int64_t kept = 0;                           ///< jobs at the end
  int64_t memory_early = 0, memory_late = 0;  ///< resident bytes when the first jobs had gone, and the most of them since
  int64_t database_early = 0, database_late = 0;
};

inline int64_t resident_bytes() {
  ::malloc_trim(0);
  int64_t pages = 0, resident = 0;
  std::ifstream("/proc/self/statm") >> pages >> resident;
  return resident * ::sysconf(_SC_PAGESIZE);
}

inline constexpr int kBetweenLooks = 2000;  ///< jobs between two looks at the memory

/// Jobs of two tasks each in batches; a batch and its clean-up are a quarter of a day, and jobs are kept for `keep_days`.
inline FastMotion fast_motion(int jobs, int batch, int keep_days) {
  const testing::MemoryFolder folder;
  RetentionWorld world(folder.path().string(), [&](CoordinatorOptions& options) {
    options.retention.keep_seconds = int64_t{keep_days} * 86400;
    options.merges_at_once = 2;
    // An image of its own for each job, without the time of a merge.
    options.assemble_tiles = [](const AssembleRequest& request) {
      std::ofstream(request.output_path) << "image of " << request.header.settings_digest;
      AssembleResult result;
      result.ok = true;
      return result;
    };
  });
  const auto begin = std::chrono::steady_clock::now();
  FastMotion motion;
  // As many are kept by then as ever will be.
  const int early = std::max(jobs / 5, 5 * batch * keep_days);
  uint64_t counter = 0;
  for (int done = 0; done < jobs;) {
    std::vector<std::string> ids;
    for (int i = 0; i < batch; ++i) ids.push_back(world.submit(fmt::format("r{}", done + i), done + i, (done + i) % 50));
    // One worker with a slot for each task.
    std::map<std::string, v1::LeaseGrant> held;
    for (int committed = 0; committed < 2 * batch;) {
      v1::SyncRequest request = world.sync_request("w1");
      request.set_slots(static_cast<uint32_t>(2 * batch));
      for (const auto& [id, grant] : held) {
        const std::string tile = "tile " + grant.task().result_key();
        world.upload(tile);
        v1::ResultOffer& offer = add_offer(request, grant, tile);
        offer.mutable_cost()->set_cpu_ns(CoordinatorWorld::kTaskCpu + static_cast<int64_t>(++counter));
        offer.mutable_cost()->set_wall_ns(CoordinatorWorld::kTaskWall);
      }
      const auto [outcome, response] = world.sync(request);
      if (!outcome.ok()) {
        ADD_FAILURE() << outcome.message;
        return motion;
      }
      for (const v1::OfferVerdict& verdict : response.verdicts()) {
        if (verdict.verdict() == v1::VERDICT_RETRY_LATER) continue;
        held.erase(verdict.lease_id());
        ++committed;
      }
      for (const v1::LeaseGrant& grant : response.grants()) held[grant.lease_id()] = grant;
    }
    for (const std::string& id : ids)
      while (world.coordinator->job(id).state() < v1::JOB_STATE_DONE) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    world.now += kDay / 4;
    world.coordinator->clean_up();
    const int before = done;
    done += batch;
    const auto passes = [&](int count) { return before / count != done / count; };
    if (!passes(kBetweenLooks) && !passes(early) && done < jobs) continue;
    const int64_t memory = resident_bytes();
    const auto database = static_cast<int64_t>(std::filesystem::file_size(folder.path() / "woodcock.sqlite"));
    if (before < early && done >= early) {
      motion.memory_early = motion.memory_late = memory;
      motion.database_early = motion.database_late = database;
    } else if (done >= early) {
      motion.memory_late = std::max(motion.memory_late, memory);
      motion.database_late = std::max(motion.database_late, database);
    }
    std::printf("%d of %d jobs in %.0f s: resident memory %.1f MiB, database %.1f MiB\n", done, jobs,
                std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(), static_cast<double>(memory) / (1 << 20),
                static_cast<double>(database) / (1 << 20));
    std::fflush(stdout);
  }
  motion.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  motion.kept = world.rows("jobs");
  EXPECT_GE(motion.kept, int64_t{batch} * (4 * keep_days - 1)) << "as many as the days have";
  EXPECT_LE(motion.kept, int64_t{batch} * 4 * keep_days);
  EXPECT_EQ(world.on_disk(), world.referenced());
  world.expect_exact_counts();
  std::printf("%d jobs in %.0f s, %lld kept; resident memory %.1f MiB early, %.1f MiB at most later; database %.1f and %.1f MiB\n", jobs,
              motion.seconds, static_cast<long long>(motion.kept), static_cast<double>(motion.memory_early) / (1 << 20),
              static_cast<double>(motion.memory_late) / (1 << 20), static_cast<double>(motion.database_early) / (1 << 20),
              static_cast<double>(motion.database_late) / (1 << 20));
  return motion;
}

}  // namespace woodcock::coordinator
