// Where a picture goes.
#pragma once

#include <filesystem>
#include <string>

namespace woodcock {

/// The file to write: `asked` where the user named one, else `from_scene`, which must not exist yet unless `resume`.
/// Throws std::runtime_error, before any work is done, where the folder does not exist or cannot be written, or the
/// name does not end in .exr.
std::filesystem::path output_path(const std::string& asked, const std::string& from_scene, bool resume);

}  // namespace woodcock
