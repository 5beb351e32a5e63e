// Kernels for scenes without media. Nothing else is compiled to measure: what is saved where there is a medium is less than can be
// measured (docs/performance.md).
#include "renderer/transport/kernel_group.h"

namespace woodcock {

std::span<const Kernel> surface_kernels() { return kernel_group<kDiffuse, kAnySurface | kTransparentSurfaces>(); }

}  // namespace woodcock
