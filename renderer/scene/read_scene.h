// Reads a pbrt-v4 scene file into a description.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "renderer/scene/description.h"

namespace woodcock {

struct ReadOptions {
  /// Directives that pbrt-v4 knows, that change the picture and are not supported are listed in
  /// `SceneDescription::ignored` instead of being errors.
  bool allow_unsupported = false;
  /// Files outside the scene's own folder may be read. Only a local user may ask for this.
  bool allow_outside_files = false;
  /// Only parse and check; do not keep volumes and meshes (for a client that ships the scene).
  bool skip_payload = false;
  /// Parameters that are set from outside: "medium.smoke.g=0.8" (parameter_edits.h). They are part of the scene's digest.
  std::vector<std::string> set;
  /// Called with one line for each warning, already prefixed by its place.
  std::function<void(const std::string&)> warn;
};

/// Throws SceneError, and std::invalid_argument for a text of `set` that is none. The root folder is the folder of `path`.
SceneDescription read_scene(const std::string& path, const ReadOptions& options);

/// The same from a text in memory; `folder` is where relative files are looked up.
SceneDescription read_scene_text(const std::string& text, const std::string& name, const std::string& folder, const ReadOptions& options);

}  // namespace woodcock
