// What a user asks of a frame beyond the scene file.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace woodcock {

/// Overrides of the scene file. Everything here except `samples` and `full_kernel` changes the radiance of a given sample
/// or the pixels there are, and is part of a result's identity.
struct FrameSettings {
  std::optional<std::array<int, 2>> resolution;  ///< width, height in pixels
  std::optional<std::array<int, 4>> crop;        ///< x0, x1, y0, y1 in pixels of the full image
  std::optional<int64_t> samples;                ///< per pixel; not part of the identity
  std::optional<uint64_t> seed;
  std::optional<int> max_depth;
  std::string estimator = "auto";
  std::string only;               ///< the terms of the transfer equation that count in media, e.g. "absorption,emission"; empty for all
  std::optional<double> step;     ///< of estimators that march, in world units
  std::optional<int> directions;  ///< of estimators that march: a step at the first scattering, or distances on the first ray
  std::optional<int> branching;   ///< of uniform-path: directions at the first bounce
  bool full_kernel = false;       ///< the kernel with every effect compiled in: the same bits
  bool plan = true;               ///< off: the general algorithm, without what was found out about the scene
  std::string without;            ///< features of `auto` that are switched off, e.g. "mis,roulette"; empty for none
  std::vector<std::string> set;   ///< parameters of the scene, e.g. "medium.smoke.g=0.8" (scene/parameter_edits.h)
  std::string aovs = "albedo,normal,depth";  ///< the optional channels of the EXR; "none" for none
  bool allow_unsupported = false;
  uint64_t frame = 0;  ///< frame number of a sequence; 0 for a still
};

}  // namespace woodcock
