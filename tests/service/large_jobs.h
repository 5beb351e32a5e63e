// Jobs of a million tasks for a coordinator in this process.
#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>

#include "tests/service/coordinator_world.h"

namespace woodcock::coordinator {

inline double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// A frame of 8000 × 8000 pixels in tiles of 8 × 8: a million tasks.
inline v1::SubmitJobRequest million_tasks(CoordinatorWorld& world, const std::string& id) {
  v1::SubmitJobRequest request = world.request(id, 16);
  request.mutable_settings()->set_tile_size(8);
  FrameHeader header = world.header();
  header.width = header.height = 8000;
  header.bounds = {0, 0, 8000, 8000};
  *request.mutable_frames(0)->mutable_header() = rpc::to_wire(header);
  return request;
}

/// The same in 10 000 frames of 100 tasks, or in fewer frames.
inline v1::SubmitJobRequest ten_thousand_frames(CoordinatorWorld& world, const std::string& id, uint64_t frames = 10'000) {
  v1::SubmitJobRequest request = world.request(id, 16);
  request.mutable_settings()->set_tile_size(8);
  const v1::FrameInput frame = request.frames(0);
  request.clear_frames();
  FrameHeader header = world.header();
  header.width = header.height = 80;
  header.bounds = {0, 0, 80, 80};
  for (uint64_t i = 0; i < frames; ++i) {
    header.frame = i;
    *request.add_frames() = frame;
    *request.mutable_frames(static_cast<int>(i))->mutable_header() = rpc::to_wire(header);
  }
  return request;
}

/// Lists jobs again and again while `work` runs, and before. Returns how long the slowest list took, seconds.
template <typename Work>
double slowest_list_during(CoordinatorWorld& world, Work work) {
  std::atomic<bool> over{false};
  std::atomic<int> calls{0};
  double slowest = 0;
  std::thread lister([&] {
    for (; !over; ++calls) {
      const auto begin = std::chrono::steady_clock::now();
      world.coordinator->list(0, "");
      slowest = std::max(slowest, seconds_since(begin));
    }
  });
  while (calls < 3) std::this_thread::yield();
  work();
  over = true;
  lister.join();
  return slowest;
}

}  // namespace woodcock::coordinator
