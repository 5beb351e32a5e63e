// Kernels for scenes with media that vary in space; some have homogeneous ones, too.
#include "renderer/transport/kernel_group.h"

namespace woodcock {

std::span<const Kernel> heterogeneous_kernels() {
  constexpr uint32_t kMedium = kHeterogeneousMedia | kPassableSurfaces, kScatters = kMedium | kScatteringMedium;
  return kernel_group<kMedium,                                         //
                      kMedium | kAnySurface,                           //
                      kMedium | kEmissiveGrid,                         //
                      kMedium | kEmissiveGrid | kAnySurface,           //
                      kScatters,                                       //
                      kScatters | kDiffuse,                            // a cloud over land
                      kScatters | kAnySurface,                         //
                      kScatters | kEmissiveGrid | kDiffuse,            // fire
                      kScatters | kEmissiveGrid | kAnySurface,         //
                      kScatters | kEquiangular | kAnySurface,          //
                      kScatters | kChromaticExtinction | kDiffuse,     //
                      kScatters | kChromaticExtinction | kAnySurface,  //
                      kScatters | kHomogeneousMedia | kAnySurface,     //
                      kScatters | kHomogeneousMedia | kEmissiveGrid | kEquiangular | kAnySurface>();
}

}  // namespace woodcock
