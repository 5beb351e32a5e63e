// What every part of the reader shares: options, files, names seen so far, and the three ways to speak up.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "renderer/scene/description.h"
#include "renderer/scene/read_scene.h"
#include "renderer/scene/scene_files.h"

namespace woodcock {

class ParameterEdits;

struct ReadContext {
  const ReadOptions& options;
  SceneFiles& files;
  SceneDescription& scene;
  ParameterEdits& edits;
  std::map<std::string, int> float_textures, rgb_textures;  ///< name → index

  void warn(const SourceLocation& where, const std::string& text) const;
  /// Something that does not change the picture and is not carried out: a warning, and an entry in `scene.ignored`.
  void ignore(const SourceLocation& where, const std::string& what);
  /// Something pbrt-v4 knows and that changes the picture. Throws, or under `allow_unsupported` records it and returns.
  void unsupported(const SourceLocation& where, const std::string& what);
};

/// " Did you mean "…"?" with the candidate nearest in edit distance, or nothing when none is near.
std::string suggestion(std::string_view found, const std::vector<std::string>& candidates);
/// `"a" "b" "c"`
std::string quoted_list(const std::vector<std::string>& names);

}  // namespace woodcock
