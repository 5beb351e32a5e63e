#include "coordinator/retention.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <exception>

#include "coordinator/blob_store.h"
#include "coordinator/store.h"
#include "rpc/failure.h"
#include "rpc/limits.h"
#include "rpc/manifest.h"

namespace woodcock::coordinator {
namespace {

constexpr int kPage = 500;

/// The files of a scene; none where its list cannot be read: the clean-up says so.
v1::SceneManifest files_of(const BlobStore& blobs, const std::string& manifest) {
  v1::SceneManifest files;
  const auto unread = rpc::failure_of([&] { files = rpc::parse_manifest(blobs.read(manifest, rpc::kMaxManifestBytes)); });
  if (unread) spdlog::warn("retention: the files of manifest {} are not counted: {}", manifest, *unread);
  return files;
}

}  // namespace

RetentionPlan::RetentionPlan(Store& store, const BlobStore& blobs, const RetentionOptions& options, int64_t total)
    : store_(store), blobs_(blobs), options_(options), total_(total) {
  read_scenes();
}

void RetentionPlan::read_scenes() {
  for (const std::string& manifest : store_.look([](StoreSession& session) { return session.manifests(); })) {
    const v1::SceneManifest scene = files_of(blobs_, manifest);
    for (const v1::SceneFile& file : scene.files()) {
      SceneFile& known = files_[digest_prefix(file.content_digest())];
      if (known.manifests++ == 0) known.bytes = blobs_.size(file.content_digest()).value_or(0);
    }
  }
}

int64_t RetentionPlan::freed_results(const std::string& job) {
  int64_t freed = 0;
  TaskRef from{job, 0, 0};
  for (bool more = true; more;) {
    more = store_.look([&](StoreSession& session) {
      const std::vector<SettledTask> page = session.settled_from(from, TaskState::Done, false, kPage);
      for (const SettledTask& row : page) {
        const int64_t uses = session.uses_of_result(row.result.key);
        // Most are used once, and need not be remembered.
        if (uses <= 1 || ++results_[digest_prefix(row.result.key)] == uses) freed += row.result.bytes;
      }
      if (!page.empty()) from = {job, page.back().frame, page.back().number + 1};
      return page.size() == kPage;
    });
  }
  return freed;
}

/// Of a scene that no frame has any more: its list, and the files that no other list has.
int64_t RetentionPlan::freed_files(const std::string& manifest) {
  int64_t freed = blobs_.size(manifest).value_or(0);
  const v1::SceneManifest scene = files_of(blobs_, manifest);
  for (const v1::SceneFile& file : scene.files()) {
    const auto known = files_.find(digest_prefix(file.content_digest()));
    if (known != files_.end() && --known->second.manifests == 0) freed += known->second.bytes;
  }
  return freed;
}

int64_t RetentionPlan::freed_by(const std::string& job) {
  // What was counted before has gone from the database meanwhile.
  if (!options_.dry_run) {
    results_.clear();
    images_.clear();
    manifests_.clear();
  }
  int64_t freed = freed_results(job);
  int from = 0;
  std::vector<std::string> scenes;
  for (bool more = true; more;) {
    more = store_.look([&](StoreSession& session) {
      const auto page = session.frame_blobs(job, from, kPage);
      for (const StoreSession::FrameBlobs& frame : page) {
        from = frame.frame + 1;
        if (!frame.image.empty()) {
          const int64_t frames = session.frames_with_image(frame.image);
          if (frames <= 1 || ++images_[digest_prefix(frame.image)] == frames) freed += frame.image_bytes;
        }
        if (++manifests_[digest_prefix(frame.manifest)] == session.frames_with_manifest(frame.manifest)) scenes.push_back(frame.manifest);
      }
      return page.size() == kPage;
    });
  }
  for (const std::string& manifest : scenes) freed += freed_files(manifest);
  return freed;
}

std::optional<RetiredJob> RetentionPlan::next() {
  if (page_.empty()) {
    for (const EndedJob& job : store_.look([&](StoreSession& session) { return session.ended_jobs({last_id_, "", last_ended_}, kPage); })) {
      page_.push_back({job.id, job.name, job.ended_unix_ms, RetentionCause::Age, 0});
      last_id_ = job.id;
      last_ended_ = job.ended_unix_ms;
    }
  }
  if (page_.empty()) return std::nullopt;
  RetiredJob job = page_.front();
  const int64_t age_ms = options_.unix_ms - job.ended_unix_ms;
  const bool old = options_.limits.keep_seconds > 0 && age_ms / 1000 > options_.limits.keep_seconds;
  if (age_ms <= options_.grace_ms || (!old && !over_size())) return std::nullopt;
  page_.pop_front();
  job.cause = old ? RetentionCause::Age : RetentionCause::Size;
  job.freed_bytes = freed_by(job.id);
  total_ -= job.freed_bytes;
  return job;
}

}  // namespace woodcock::coordinator
