// Kernels for scenes whose media are all homogeneous.
#include "renderer/transport/kernel_group.h"

namespace woodcock {

std::span<const Kernel> homogeneous_kernels() {
  constexpr uint32_t kMedium = kHomogeneousMedia, kScatters = kMedium | kScatteringMedium;
  return kernel_group<kMedium | kBoundaries,                                         //
                      kMedium | kBoundaries | kDiffuse,                              //
                      kMedium | kBoundaries | kAnySurface,                           //
                      kMedium | kBoundaries | kAnySurface | kVolumeEmission,         //
                      kScatters | kBoundaries,                                       //
                      kScatters | kBoundaries | kDiffuse,                            //
                      kScatters | kAnySurface,                                       // milk in a glass
                      kScatters | kBoundaries | kAnySurface,                         //
                      kScatters | kEquiangular | kDiffuse,                           // fog
                      kScatters | kEquiangular | kBoundaries | kAnySurface,          //
                      kScatters | kChromaticExtinction | kAnySurface,                //
                      kScatters | kChromaticExtinction | kBoundaries | kAnySurface,  //
                      kScatters | kChromaticExtinction | kEquiangular | kVolumeEmission | kBoundaries | kAnySurface>();
}

}  // namespace woodcock
