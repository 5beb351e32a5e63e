// What a user asks of a frame beyond the scene file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

namespace woodcock {

/// Overrides of the scene file. Everything here except `samples` changes the radiance of a given sample or
/// the pixels there are, and is part of a result's identity.
struct FrameSettings {
  std::optional<std::array<int, 2>> resolution;  ///< width, height in pixels
  std::optional<std::array<int, 4>> crop;        ///< x0, x1, y0, y1 in pixels of the full image
  std::optional<int64_t> samples;                ///< per pixel; not part of the identity
  std::optional<uint64_t> seed;
  std::optional<int> max_depth;
  std::string estimator = "auto";
  std::string aovs = "albedo,normal,depth";  ///< the optional channels of the EXR; "none" for none
  bool allow_unsupported = false;
  uint64_t frame = 0;  ///< frame number of a sequence; 0 for a still
};

}  // namespace woodcock
