// Kernels for scenes whose media are all homogeneous.
#include "renderer/transport/kernel_group.h"

namespace woodcock {

std::span<const Kernel> homogeneous_kernels() {
  constexpr uint32_t kMedium = kHomogeneousMedia, kScatters = kMedium | kScatteringMedium, kBoundary = kPassableSurfaces;
  return kernel_group<kMedium | kBoundary,                                         //
                      kMedium | kBoundary | kDiffuse,                              //
                      kMedium | kBoundary | kAnySurface,                           //
                      kMedium | kBoundary | kAnySurface | kVolumeEmission,         //
                      kScatters | kBoundary,                                       //
                      kScatters | kBoundary | kDiffuse,                            //
                      kScatters | kAnySurface,                                     // milk in a glass
                      kScatters | kBoundary | kAnySurface,                         //
                      kScatters | kEquiangular | kDiffuse,                         // fog
                      kScatters | kEquiangular | kBoundary | kAnySurface,          //
                      kScatters | kChromaticExtinction | kAnySurface,              //
                      kScatters | kChromaticExtinction | kBoundary | kAnySurface,  //
                      kScatters | kChromaticExtinction | kEquiangular | kVolumeEmission | kBoundary | kAnySurface>();
}

}  // namespace woodcock
