// Which jobs go: those that ended first, by age and by the bytes that all have on the disk.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <unordered_map>

#include "coordinator/model.h"

namespace woodcock::coordinator {

class BlobStore;
class DigestSet;
class Store;

struct RetentionLimits {
  int64_t keep_seconds = 0;  ///< a job goes that ended longer ago; 0: never for that
  int64_t keep_bytes = 0;    ///< of results, images and scene files that jobs have; 0: any number

  bool any() const { return keep_seconds > 0 || keep_bytes > 0; }
};

/// The database and the wire have these numbers.
enum class RetentionCause { Age = 1, Size = 2 };

/// A job that goes.
struct RetiredJob {
  std::string id, name;
  int64_t ended_unix_ms = 0;
  RetentionCause cause = RetentionCause::Age;
  int64_t freed_bytes = 0;  ///< what no job has that stays, and none has that went before it
};

struct RetentionOptions {
  RetentionLimits limits;
  int64_t unix_ms = 0;   ///< now
  int64_t grace_ms = 0;  ///< a job stays for so long after it ended, whatever the limits: who waited for it may still fetch it
  bool dry_run = false;  ///< nothing is deleted between two jobs
};

/// Names the jobs one after the other. Reads the database in pages; its memory is that of the scenes, in a dry run also of what several
/// of the jobs share.
class RetentionPlan {
 public:
  /// `total`: bytes of all that is referred to.
  RetentionPlan(Store& store, const BlobStore& blobs, const RetentionOptions& options, int64_t total);

  /// The next job that goes, counted as gone from now on. Without a dry run it is deleted, rows and all, before one asks again.
  std::optional<RetiredJob> next();
  /// Bytes of what stays.
  int64_t bytes() const { return total_; }
  bool over_size() const { return options_.limits.keep_bytes > 0 && total_ > options_.limits.keep_bytes; }
  /// Results that no task has go before any job.
  void free_unused(int64_t bytes) { total_ -= bytes; }

 private:
  struct SceneFile {
    int64_t manifests = 0;  ///< that list it and stay
    int64_t bytes = 0;
  };

  void read_scenes();
  int64_t freed_by(const std::string& job);
  int64_t freed_results(const std::string& job);
  int64_t freed_files(const std::string& manifest);

  Store& store_;
  const BlobStore& blobs_;
  const RetentionOptions options_;
  int64_t total_ = 0;
  std::string last_id_;
  int64_t last_ended_ = -1;
  std::deque<RetiredJob> page_;
  // By the first 64 bits of key or digest.
  std::unordered_map<uint64_t, SceneFile> files_;
  std::unordered_map<uint64_t, int64_t> results_, images_, manifests_;  ///< how many tasks or frames of jobs that went had it
};

}  // namespace woodcock::coordinator
