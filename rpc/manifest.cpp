#include "rpc/manifest.h"

#include <algorithm>
#include <unordered_set>

#include "renderer/core/sha256.h"
#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/limits.h"
#include "rpc/text_fields.h"

namespace woodcock::rpc {

bool is_safe_path(std::string_view path) {
  if (path.empty() || path.size() > kMaxPathBytes) return false;
  if (std::any_of(path.begin(), path.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f || c == '\\'; }))
    return false;
  for (size_t begin = 0; begin <= path.size();) {
    const size_t end = std::min(path.find('/', begin), path.size());
    const std::string_view name = path.substr(begin, end - begin);
    if (name.empty() || name == "." || name == ".." || name.size() > 255) return false;
    begin = end + 1;
  }
  return true;
}

std::string serialize_manifest(v1::SceneManifest manifest) {
  std::sort(manifest.mutable_files()->begin(), manifest.mutable_files()->end(),
            [](const v1::SceneFile& a, const v1::SceneFile& b) { return a.path() < b.path(); });
  check_text_fields(manifest);
  // Fields are written in the order of their numbers, and there are neither maps nor unknown fields.
  return manifest.SerializeAsString();
}

v1::SceneManifest parse_manifest(const std::string& bytes) {
  v1::SceneManifest manifest;
  if (bytes.size() > static_cast<size_t>(kMaxManifestBytes) || !manifest.ParseFromString(bytes))
    fail_invalid("the manifest is not a serialized SceneManifest of at most 16 MiB");
  if (manifest.files().empty() || static_cast<size_t>(manifest.files_size()) > kMaxManifestFiles)
    fail_invalid("a manifest lists 1 to 100000 files");
  std::unordered_set<std::string_view> paths;
  for (const v1::SceneFile& file : manifest.files()) {
    if (!is_safe_path(file.path())) fail_invalid("the manifest's path \"" + file.path() + "\" leaves the scene's folder or is malformed");
    if (!paths.insert(file.path()).second) fail_invalid("the manifest lists \"" + file.path() + "\" twice");
    checked_digest(file.content_digest(), "content_digest of " + file.path());
    if (file.bytes() < 0 || file.bytes() > kMaxBlobBytes) fail_invalid("the manifest's size of \"" + file.path() + "\" is out of bounds");
  }
  return manifest;
}

std::string blob_digest(std::string_view bytes) { return Sha256().raw(bytes.data(), bytes.size()).hex(); }

}  // namespace woodcock::rpc
