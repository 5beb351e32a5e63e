#include "worker/scene_store.h"

#include <algorithm>
#include <chrono>
#include <vector>

#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/manifest.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

constexpr const char* kAside = ".building";

void touch(const fs::path& path) {
  std::error_code ignored;  // only the order of eviction depends on it
  fs::last_write_time(path, fs::file_time_type::clock::now(), ignored);
}

/// Paths of a folder's entries, the one touched longest ago first.
std::vector<fs::path> oldest_first(const fs::path& folder) {
  std::vector<std::pair<fs::file_time_type, fs::path>> entries;
  for (const auto& entry : fs::directory_iterator(folder)) entries.emplace_back(entry.last_write_time(), entry.path());
  std::sort(entries.begin(), entries.end());
  std::vector<fs::path> paths;
  for (auto& [time, path] : entries) paths.push_back(std::move(path));
  return paths;
}

}  // namespace

SceneStore::SceneStore(fs::path folder, uint64_t limit_bytes)
    : blobs_(folder / "blobs"), scenes_(folder / "scenes"), limit_bytes_(limit_bytes) {
  fs::create_directories(blobs_);
  fs::create_directories(scenes_);
  fs::remove_all(scenes_ / kAside);
}

fs::path SceneStore::prepare(const std::string& manifest_digest, const BlobSource& source) {
  const fs::path folder = scenes_ / rpc::checked_digest(manifest_digest, "manifest_digest");
  if (!fs::exists(folder)) {
    const v1::SceneManifest manifest = rpc::parse_manifest(source.bytes(manifest_digest));
    for (const v1::SceneFile& file : manifest.files()) {
      const fs::path blob = blobs_ / file.content_digest();
      if (!fs::exists(blob)) source.file(file.content_digest(), blob);
      if (fs::file_size(blob) != static_cast<uint64_t>(file.bytes()))
        throw rpc::RpcError(rpc::Code::kInvalidArgument, "the manifest's size of " + file.path() + " is not that of its content");
      touch(blob);
    }
    fs::remove_all(scenes_ / kAside);
    lay_out(manifest, scenes_ / kAside);
    fs::rename(scenes_ / kAside, folder);
  }
  touch(folder);
  return folder;
}

void SceneStore::lay_out(const v1::SceneManifest& manifest, const fs::path& folder) const {
  fs::create_directories(folder);
  for (const v1::SceneFile& file : manifest.files()) {
    const fs::path path = folder / file.path();  // rpc::parse_manifest has checked that it stays inside
    fs::create_directories(path.parent_path());
    std::error_code no_links;
    fs::create_hard_link(blobs_ / file.content_digest(), path, no_links);
    if (no_links) fs::copy_file(blobs_ / file.content_digest(), path);
  }
}

uint64_t SceneStore::blob_bytes() const {
  uint64_t total = 0;
  for (const auto& entry : fs::directory_iterator(blobs_)) total += entry.file_size();
  return total;
}

void SceneStore::trim(const std::set<std::string>& manifests_in_use) {
  uint64_t total = blob_bytes();
  if (total <= limit_bytes_) return;
  const auto remove_loose_blobs = [&] {
    for (const fs::path& blob : oldest_first(blobs_)) {
      if (total <= limit_bytes_) return;
      if (fs::hard_link_count(blob) > 1) continue;
      total -= fs::file_size(blob);
      fs::remove(blob);
    }
  };
  remove_loose_blobs();
  for (const fs::path& scene : oldest_first(scenes_)) {
    if (total <= limit_bytes_) return;
    if (manifests_in_use.contains(scene.filename())) continue;
    fs::remove_all(scene);
    remove_loose_blobs();
  }
}

void SceneStore::discard(const std::string& manifest_digest) {
  const fs::path folder = scenes_ / rpc::checked_digest(manifest_digest, "manifest_digest");
  if (!fs::exists(folder)) return;
  std::vector<fs::path> blobs;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    for (const auto& blob : fs::directory_iterator(blobs_))
      if (fs::equivalent(blob.path(), entry.path())) blobs.push_back(blob.path());
  }
  for (const fs::path& blob : blobs) fs::remove(blob);
  fs::remove_all(folder);
}

}  // namespace woodcock
