// Bounds on what a peer may send, and how long anyone waits. Both sides check them: the sender to fail early, the receiver
// because it trusts nobody.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>

namespace woodcock::rpc {

inline constexpr uint32_t kProtocolMajor = 1;
inline constexpr uint32_t kProtocolMinor = 0;

inline constexpr int kMaxMessageBytes = 16 << 20;
inline constexpr size_t kChunkBytes = 1 << 20;
inline constexpr int64_t kMaxBlobBytes = int64_t{64} << 30;
inline constexpr int64_t kMaxManifestBytes = int64_t{16} << 20;
inline constexpr size_t kMaxManifestFiles = 100'000;
inline constexpr size_t kMaxPathBytes = 1024;
inline constexpr size_t kMaxDigestsPerCall = 10'000;

inline constexpr size_t kMaxFramesPerJob = 10'000;
inline constexpr int64_t kMaxTasksPerJob = 1'000'000;
inline constexpr int kMaxResolution = 65'536;  ///< pixels of an edge
inline constexpr int64_t kMaxSamplesPerPixel = int64_t{1} << 40;
inline constexpr size_t kMaxSettings = 256;
inline constexpr size_t kMaxSettingBytes = 4096;
inline constexpr size_t kMaxListBytes = 512;  ///< of words separated by commas
inline constexpr int kMaxSetParameters = 32;
inline constexpr size_t kMaxSetBytes = 4096;
inline constexpr int kMaxDirections = 1024;  ///< that a path may branch into
inline constexpr size_t kMaxNameBytes = 200;
inline constexpr size_t kMaxIdBytes = 64;
inline constexpr size_t kMaxBuildBytes = 256;
inline constexpr size_t kMaxMessageTextBytes = 1024;
inline constexpr size_t kMaxLogExcerptBytes = 16 << 10;
inline constexpr size_t kMaxSyncListItems = 1024;
inline constexpr uint32_t kMaxSlots = 256;
inline constexpr int32_t kMaxPriority = 100;
inline constexpr int kMaxTags = 32;                                                               ///< of a worker, or asked of one
inline constexpr int64_t kMaxTaskMemory = int64_t{1} << 50, kMaxWorkerMemory = int64_t{1} << 60;  ///< bytes
inline constexpr uint32_t kMaxWorkersOfJob = 100'000;
inline constexpr int kMaxJobsBefore = 64;  ///< that a job waits for
inline constexpr double kMaxQuotedError = 1e6;
inline constexpr double kMaxQuotedSeconds = 1e15;

/// How long the coordinator holds a Sync at most, and the deadline that a worker gives it.
inline constexpr std::chrono::milliseconds kSyncHold{10'000};
inline constexpr std::chrono::milliseconds kSyncDeadline{30'000};
/// Deadline of a call that answers from memory or one database commit.
inline constexpr std::chrono::milliseconds kCallDeadline{30'000};
/// A blob stream ends when no chunk moved for this long.
inline constexpr std::chrono::milliseconds kChunkDeadline{60'000};

}  // namespace woodcock::rpc
