// The frames of a sequence as farms write them: "1-100", "1-100x5", "1-100x5,200".
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace woodcock {

/// Which frames, in the order they were asked for, each once.
struct FrameList {
  std::vector<uint64_t> frames;
  std::vector<uint64_t> repeated;  ///< those that the text names more than once, each once, in the order found
};

/// Reads frames and ranges between commas; a range A-B holds both ends, A-BxS every S-th frame from A on. At most 10 000 frames, those
/// counted twice that are named twice. Throws std::invalid_argument that says at which character what was found and what was expected.
FrameList parse_frame_list(const std::string& text);

/// "1-3, 7, 9-11": for people. At most `limit` ranges are written, then "…".
std::string describe_frames(std::vector<uint64_t> frames, size_t limit = 8);

}  // namespace woodcock
