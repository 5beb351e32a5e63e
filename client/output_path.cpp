#include "client/output_path.h"

#include <unistd.h>

#include <stdexcept>

#include "renderer/film/picture_file.h"

namespace woodcock {

std::filesystem::path output_path(const std::string& asked, const std::string& from_scene, bool resume) {
  namespace fs = std::filesystem;
  // A scene's own name must not lead anywhere but here.
  fs::path path = asked.empty() ? fs::path(from_scene).filename() : fs::path(asked);
  if (path.extension() != ".exr") {
    if (!asked.empty()) throw std::runtime_error("output \"" + asked + "\": expected a name that ends in .exr");
    path.replace_extension(".exr");
  }
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::is_directory(folder))
    throw std::runtime_error("output \"" + path.string() + "\": the folder " + folder.string() + " does not exist; create it first");
  if (access(folder.c_str(), W_OK | X_OK) != 0)
    throw std::runtime_error("output \"" + path.string() + "\": the folder " + folder.string() + " cannot be written");
  if (fs::is_directory(path)) throw std::runtime_error("output \"" + path.string() + "\" is a folder; expected a file name");
  const fs::path nodes = nodes_path(path);
  if (is_nodes_name(path))
    throw std::runtime_error("output \"" + path.string() +
                             "\": names that end in .nodes.exr are for the nodes beside a picture; name it otherwise");
  if (asked.empty() && !resume)
    for (const fs::path& there : {path, nodes})
      if (fs::exists(there))
        throw std::runtime_error("output \"" + there.string() +
                                 "\", the scene's own name, exists already; name one with -o to overwrite it");
  if (fs::exists(nodes) && look_at(nodes).kind != FrameFile::Kind::kNodes)
    throw std::runtime_error("output \"" + path.string() + "\": its nodes go to " + nodes.string() +
                             ", which is there and holds something else; move it away or choose another name");
  return path;
}

}  // namespace woodcock
