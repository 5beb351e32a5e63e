#include "renderer/scene/read_scene.h"

#include <filesystem>

#include "renderer/scene/limits.h"
#include "renderer/scene/parser.h"
#include "renderer/scene/scene_builder.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

SceneDescription read_text(const std::string& text, const std::string& name, const std::filesystem::path& file, SceneFiles& files,
                           const ReadOptions& options) {
  SceneDescription scene;
  ReadContext context{options, files, scene, {}, {}};
  SceneBuilder builder(context);
  Parser parser(context, builder, file);
  parser.parse(text, name, files.root());
  builder.finish({name, 1, 1});
  scene.files = files.manifest(name);
  scene.digest = scene_digest(scene.files);
  return scene;
}

}  // namespace

SceneDescription read_scene(const std::string& path, const ReadOptions& options) {
  const SourceLocation start{path, 1, 1};
  SceneFiles files(std::filesystem::path(path).parent_path(), options.allow_outside_files);
  const std::filesystem::path name = std::filesystem::path(path).filename();
  const std::filesystem::path file = files.resolve(name.string(), files.root(), start);
  const std::string text = files.read(file, limits::kTextBytes, start);
  return read_text(text, files.display_name(file), file, files, options);
}

SceneDescription read_scene_text(const std::string& text, const std::string& name, const std::string& folder, const ReadOptions& options) {
  SceneFiles files(folder, options.allow_outside_files);
  files.record_text(name, text);
  return read_text(text, name, {}, files, options);
}

}  // namespace woodcock
