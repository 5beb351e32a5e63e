#include "worker/scene_store.h"

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <vector>

#include "renderer/core/sha256.h"
#include "renderer/film/atomic_file.h"
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

/// Paths of a folder's entries, the one touched longest ago first. What cannot be read is the oldest.
std::vector<fs::path> oldest_first(const fs::path& folder) {
  std::vector<std::pair<fs::file_time_type, fs::path>> entries;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code unknown;
    const fs::file_time_type time = it->last_write_time(unknown);
    entries.emplace_back(unknown ? fs::file_time_type::min() : time, it->path());
  }
  std::sort(entries.begin(), entries.end());
  std::vector<fs::path> paths;
  for (auto& [time, path] : entries) paths.push_back(std::move(path));
  return paths;
}

uint64_t bytes_of(const fs::path& path) {
  std::error_code unreadable;
  const uintmax_t bytes = fs::file_size(path, unreadable);
  return unreadable ? 0 : bytes;
}

/// Whether this is a file with that content. What cannot be read is not.
bool holds(const fs::path& path, const std::string& digest, const std::function<void()>& moved = {}) {
  std::error_code unreadable;
  if (!fs::is_regular_file(path, unreadable)) return false;
  std::ifstream file(path, std::ios::binary);
  Sha256 hash;
  std::vector<char> buffer(size_t{1} << 20);
  while (file) {
    file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()));
    hash.raw(buffer.data(), static_cast<size_t>(file.gcount()));
    if (moved) moved();
  }
  return file.eof() && hash.hex() == digest;
}

void remove_quietly(const fs::path& path) {
  std::error_code ignored;  // what stays is found again
  fs::remove_all(path, ignored);
}

}  // namespace

SceneStore::SceneStore(fs::path folder, uint64_t limit_bytes)
    : blobs_(folder / "blobs"), manifests_(folder / "manifests"), scenes_(folder / "scenes"), limit_bytes_(limit_bytes) {
  for (const fs::path& part : {blobs_, manifests_, scenes_}) fs::create_directories(part);
  remove_quietly(scenes_ / kAside);
}

v1::SceneManifest SceneStore::manifest_of(const std::string& digest, const BlobSource& source) const {
  const fs::path path = manifests_ / digest;
  if (!holds(path, digest)) {
    const std::string bytes = source.bytes(digest);
    remove_quietly(path);
    fs::create_directories(manifests_);
    write_text(path, bytes);
    return rpc::parse_manifest(bytes);
  }
  std::ifstream file(path, std::ios::binary);
  return rpc::parse_manifest({std::istreambuf_iterator<char>(file), {}});
}

fs::path SceneStore::prepare(const std::string& manifest_digest, const BlobSource& source) {
  const fs::path folder = scenes_ / rpc::checked_digest(manifest_digest, "manifest_digest");
  std::error_code unreadable;
  if (!checked_.contains(manifest_digest) || !fs::is_directory(folder, unreadable)) {
    const v1::SceneManifest manifest = manifest_of(manifest_digest, source);
    const bool whole = std::all_of(manifest.files().begin(), manifest.files().end(), [&](const v1::SceneFile& file) {
      return holds(folder / file.path(), file.content_digest(), source.moved);
    });
    if (!whole) {
      for (const fs::path& part : {blobs_, scenes_}) fs::create_directories(part);
      for (const v1::SceneFile& file : manifest.files()) {
        const fs::path blob = blobs_ / file.content_digest();
        if (!holds(blob, file.content_digest(), source.moved)) {
          remove_quietly(blob);
          source.file(file.content_digest(), blob);
        }
        if (bytes_of(blob) != static_cast<uint64_t>(file.bytes()))
          throw rpc::RpcError(rpc::Code::kInvalidArgument, "the manifest's size of " + file.path() + " is not that of its content");
        touch(blob);
      }
      remove_quietly(scenes_ / kAside);
      lay_out(manifest, scenes_ / kAside);
      remove_quietly(folder);
      fs::rename(scenes_ / kAside, folder);
    }
    checked_.insert(manifest_digest);
  }
  touch(folder);
  return folder;
}

bool SceneStore::check(const std::string& manifest_digest, std::string& why) {
  const fs::path folder = scenes_ / rpc::checked_digest(manifest_digest, "manifest_digest"), list = manifests_ / manifest_digest;
  why.clear();
  if (holds(list, manifest_digest)) {
    std::ifstream in(list, std::ios::binary);
    const v1::SceneManifest manifest = rpc::parse_manifest({std::istreambuf_iterator<char>(in), {}});
    for (const v1::SceneFile& file : manifest.files())
      if (!holds(folder / file.path(), file.content_digest())) why = file.path() + " does not have its digest";
  } else {
    why = "its list of files cannot be read";
  }
  if (why.empty()) return true;
  // prepare() looks at each blob before it uses it again.
  checked_.erase(manifest_digest);
  remove_quietly(folder);
  return false;
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
  for (const fs::path& blob : oldest_first(blobs_)) total += bytes_of(blob);
  return total;
}

void SceneStore::trim(const std::set<std::string>& manifests_in_use) {
  uint64_t total = blob_bytes();
  if (total <= limit_bytes_) return;
  const auto remove_loose_blobs = [&] {
    for (const fs::path& blob : oldest_first(blobs_)) {
      if (total <= limit_bytes_) return;
      std::error_code unreadable;
      if (fs::hard_link_count(blob, unreadable) > 1 && !unreadable) continue;
      total -= bytes_of(blob);
      remove_quietly(blob);
    }
  };
  remove_loose_blobs();
  for (const fs::path& scene : oldest_first(scenes_)) {
    if (total <= limit_bytes_) return;
    const std::string digest = scene.filename();
    if (manifests_in_use.contains(digest)) continue;
    checked_.erase(digest);
    remove_quietly(scene);
    remove_quietly(manifests_ / digest);
    remove_loose_blobs();
  }
}

void SceneStore::discard(const std::string& manifest_digest) {
  const fs::path folder = scenes_ / rpc::checked_digest(manifest_digest, "manifest_digest"), list = manifests_ / manifest_digest;
  if (holds(list, manifest_digest)) {
    std::ifstream in(list, std::ios::binary);
    const v1::SceneManifest manifest = rpc::parse_manifest({std::istreambuf_iterator<char>(in), {}});
    for (const v1::SceneFile& file : manifest.files()) remove_quietly(blobs_ / file.content_digest());
  }
  checked_.erase(manifest_digest);
  remove_quietly(folder);
  remove_quietly(list);
}

}  // namespace woodcock
