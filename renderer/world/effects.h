// The effects that cost code when simulated, as bits: what a scene calls for, and what a kernel is compiled for.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

namespace woodcock {

/// A set of effects is the bitwise or of its members.
enum Effect : uint32_t {
  kHomogeneousMedia = 1u << 0,     ///< a ray may be in a medium with the same coefficients everywhere
  kHeterogeneousMedia = 1u << 1,   ///< ... in one that varies in space
  kVolumeScattering = 1u << 2,     ///< some medium scatters
  kVolumeEmission = 1u << 3,       ///< some medium emits
  kChromaticExtinction = 1u << 4,  ///< the extinction of some medium differs between channels
  kTransparentSurfaces = 1u << 5,  ///< interfaces, partial opacity: shadow rays may have to go on
  kSurfaces = 1u << 6,             ///< some shape has a material
  kGeneralSurfaces = 1u << 7,      ///< ... that is not plain diffuse
  kLightSampling = 1u << 8,        ///< some light can be sampled from a point
  kEquiangular = 1u << 9,          ///< a bounded light in or beside a medium thin enough that it matters where it stands
  kEmissionSampling = 1u << 10,    ///< a grid emits: its bricks are lights
  kRefractedLight = 1u << 11,      ///< an area light shines into a sphere of smooth glass that holds something
};
/// In the order of the bits.
inline constexpr std::array<std::pair<Effect, const char*>, 12> kEffectNames{{{kHomogeneousMedia, "homogeneous media"},
                                                                              {kHeterogeneousMedia, "heterogeneous media"},
                                                                              {kVolumeScattering, "volume scattering"},
                                                                              {kVolumeEmission, "volume emission"},
                                                                              {kChromaticExtinction, "chromatic extinction"},
                                                                              {kTransparentSurfaces, "transparent surfaces"},
                                                                              {kSurfaces, "surfaces"},
                                                                              {kGeneralSurfaces, "surfaces other than diffuse"},
                                                                              {kLightSampling, "light sampling"},
                                                                              {kEquiangular, "equiangular sampling"},
                                                                              {kEmissionSampling, "emissive bricks as lights"},
                                                                              {kRefractedLight, "light through smooth glass"}}};
inline constexpr uint32_t kAllEffects = (1u << 12) - 1;

}  // namespace woodcock
