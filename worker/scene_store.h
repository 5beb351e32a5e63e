// Scenes on the worker's disk: files named by content, and folders in which they lie under their own names.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>

#include "woodcock/v1/common.pb.h"

namespace woodcock {

/// How the store gets what it lacks. Both throw when they cannot.
struct BlobSource {
  /// A small blob, verified.
  std::function<std::string(const std::string& digest)> bytes;
  /// Puts a blob at `path`: whole, verified and durable, or not at all. An interrupted fetch may leave `path`.part to
  /// go on from.
  std::function<void(const std::string& digest, const std::string& path)> file;
  /// Called now and then while files are read to check them; may be empty.
  std::function<void()> moved{};
};

/// Layout: blobs/DIGEST, manifests/DIGEST, and scenes/MANIFEST_DIGEST/… with hard links into blobs (copies where the file system has no
/// links). A scene folder is built aside and renamed, so that it is whole when it is there. Not thread-safe.
class SceneStore {
 public:
  /// Removes what an earlier process left unfinished, except partial downloads. `limit_bytes` bounds the blobs that
  /// are kept; scenes in use are never removed, so they may exceed it.
  SceneStore(std::filesystem::path folder, uint64_t limit_bytes);

  /// The folder of this scene, fetched and laid out if need be. The first time in a process its files are read and compared with
  /// their digests: what is damaged, or cannot be read, is fetched again. Throws rpc::RpcError for a manifest that is malformed or has
  /// unsafe paths, std::system_error for the disk, and what `source` throws.
  std::filesystem::path prepare(const std::string& manifest_digest, const BlobSource& source);

  /// Removes least recently used scenes, then blobs that no scene links, until the limit holds.
  void trim(const std::set<std::string>& manifests_in_use);

  /// Reads the scene's files again. False, with a sentence, when one is not what its digest says: that is thrown away, and the next
  /// prepare() fetches it.
  bool check(const std::string& manifest_digest, std::string& why);

  /// Forgets a scene and its blobs.
  void discard(const std::string& manifest_digest);

  uint64_t blob_bytes() const;

 private:
  v1::SceneManifest manifest_of(const std::string& digest, const BlobSource& source) const;
  void lay_out(const v1::SceneManifest& manifest, const std::filesystem::path& folder) const;

  std::filesystem::path blobs_, manifests_, scenes_;
  std::set<std::string> checked_;  // by this process
  uint64_t limit_bytes_;
};

}  // namespace woodcock
