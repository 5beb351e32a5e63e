// Where a picture goes.
#pragma once

#include <filesystem>
#include <string>

namespace woodcock {

/// The picture to write: `asked` where the user named one, else `from_scene`, which must not exist yet unless `resume`. Its nodes go
/// beside it (renderer/film/picture_file.h). Throws std::runtime_error, before any work is done, where the folder does not exist or
/// cannot be written, the name does not end in .exr or is one of nodes, or a file of another kind lies where the nodes go.
std::filesystem::path output_path(const std::string& asked, const std::string& from_scene, bool resume);

}  // namespace woodcock
