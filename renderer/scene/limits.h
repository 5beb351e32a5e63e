// How much a scene file may ask for. Every file is treated as hostile: each count below is checked before the
// memory or time it stands for is spent. The numbers are far above what scenes need.
#pragma once

#include <cstddef>
#include <cstdint>

namespace woodcock::limits {

inline constexpr int kIncludeDepth = 32;
inline constexpr int kNesting = 1024;                  ///< AttributeBegin within AttributeBegin …
inline constexpr int64_t kTokens = int64_t{1} << 30;   ///< over all included files
inline constexpr int64_t kIncludes = 100'000;          ///< files included, counted each time
inline constexpr int64_t kObjects = int64_t{1} << 24;  ///< shapes, instances, lights: each
inline constexpr int kNamedThings = 1 << 20;           ///< materials, media, textures, objects, coordinate systems
inline constexpr int kDefaultAttributes = 1024;        ///< parameters of `Attribute` directives in force
inline constexpr int kResolution = 65536;              ///< pixels along one axis
inline constexpr int64_t kSamples = int64_t{1} << 40;  ///< samples per pixel
inline constexpr uint64_t kTextBytes = uint64_t{4} << 30;
inline constexpr uint64_t kFileBytes = uint64_t{64} << 30;
inline constexpr int64_t kGridSide = 16384;  ///< voxels along one axis
inline constexpr int64_t kGridVoxels = int64_t{1} << 32;

}  // namespace woodcock::limits
