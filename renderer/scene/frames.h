// Scenes of several frames: `####` in a file name is the frame number.
#pragma once

#include <string>

namespace woodcock {

/// `pattern` with its run of '#' replaced by `frame`, padded with zeros to the length of the run ("smoke.####.pbrt", 7 →
/// "smoke.0007.pbrt"). Without a '#' the pattern itself. Only the file name is looked at, not its folders; of several runs the last one
/// counts.
std::string scene_path_for_frame(const std::string& pattern, int frame);

/// Whether `pattern` names a scene of several frames.
bool has_frame_number(const std::string& pattern);

}  // namespace woodcock
