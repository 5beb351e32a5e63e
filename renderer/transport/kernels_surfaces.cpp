// Kernels for scenes without media.
#include "renderer/transport/kernel_group.h"

namespace woodcock {

std::span<const Kernel> surface_kernels() {
  return kernel_group<kDiffuse,                      //
                      kAnySurface,                   //
                      kDiffuse | kPassableSurfaces,  //
                      kAnySurface | kPassableSurfaces>();
}

}  // namespace woodcock
