#include "renderer/scene/read_scene.h"

#include <filesystem>

#include "renderer/core/sha256.h"
#include "renderer/scene/limits.h"
#include "renderer/scene/parameter_edits.h"
#include "renderer/scene/parser.h"
#include "renderer/scene/scene_builder.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

SceneDescription read_text(const std::string& text, const std::string& name, const std::filesystem::path& file, SceneFiles& files,
                           const ReadOptions& options) {
  SceneDescription scene;
  ParameterEdits edits(options.set);
  ReadContext context{options, files, scene, edits, {}, {}};
  SceneBuilder builder(context);
  Parser parser(context, builder, file);
  parser.parse(text, name, files.root());
  edits.finish();
  builder.finish({name, 1, 1});
  scene.files = files.manifest(name);
  scene.digest = scene_digest(scene.files);
  scene.set = edits.text();
  if (!scene.set.empty()) scene.digest = Sha256().field(scene.digest).field(scene.set).hex();
  return scene;
}

}  // namespace

SceneDescription read_scene(const std::string& path, const ReadOptions& options) {
  const SourceLocation start{path, 1, 1};
  SceneFiles files(std::filesystem::path(path).parent_path(), options.allow_outside_files);
  const std::filesystem::path name = std::filesystem::path(path).filename();
  const std::filesystem::path file = files.resolve(name.string(), files.root(), start);
  const std::string text = files.read_unpacked(file, limits::kTextBytes, start);
  return read_text(text, files.display_name(file), file, files, options);
}

SceneDescription read_scene_text(const std::string& text, const std::string& name, const std::string& folder, const ReadOptions& options) {
  SceneFiles files(folder, options.allow_outside_files);
  files.record_text(name, text);
  return read_text(text, name, {}, files, options);
}

}  // namespace woodcock
