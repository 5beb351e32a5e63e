// The only door to the file system for scene loading: finds files, refuses what may not be read, hashes what is.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "renderer/scene/description.h"

namespace woodcock {

/// Files below one root folder. All errors are SceneErrors at the place that refers to the file.
class SceneFiles {
 public:
  /// `root` is the scene's own folder; files elsewhere are refused unless `allow_outside`.
  SceneFiles(const std::filesystem::path& root, bool allow_outside);

  /// The canonical path of `name`, looked up in `folder`, then in the root. A backslash stands for a slash where there is no file of the
  /// very name. Throws when it does not exist, is not a regular file, or lies outside the root once `..` and symbolic links are resolved.
  std::filesystem::path resolve(const std::string& name, const std::filesystem::path& folder, const SourceLocation& where) const;

  /// Content of a resolved file; it enters the manifest. Throws when it is larger than `max_bytes`.
  std::string read(const std::filesystem::path& file, uint64_t max_bytes, const SourceLocation& where);
  /// The same for a text or a mesh, which may be packed with gzip: what is packed is told by its first bytes. `max_bytes` bounds both the
  /// file and its unpacked content; the manifest lists the file as it is.
  std::string read_unpacked(const std::filesystem::path& file, uint64_t max_bytes, const SourceLocation& where);
  /// Hashes a file that is read later by somebody else (an image); it enters the manifest.
  void record(const std::filesystem::path& file, const SourceLocation& where);
  /// Enters a text that came from memory.
  void record_text(const std::string& name, const std::string& text);

  /// `file` as the user would name it: relative to the root where it lies below it.
  std::string display_name(const std::filesystem::path& file) const;
  const std::filesystem::path& root() const { return root_; }

  /// The manifest: `main` (a relative path) first, the others sorted by path.
  std::vector<SceneFile> manifest(const std::string& main) const;

 private:
  std::filesystem::path find(const std::string& name, const std::filesystem::path& folder, const SourceLocation& where) const;

  std::filesystem::path root_;
  bool allow_outside_;
  std::map<std::string, SceneFile> files_;
};

/// SHA-256 over the sorted (relative path, content digest) pairs and the name of the first file. Moving the folder does not change it.
std::string scene_digest(const std::vector<SceneFile>& files);

}  // namespace woodcock
