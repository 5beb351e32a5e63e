// The kernel with every effect compiled in.
#include "renderer/transport/kernel_group.h"

namespace woodcock {

std::span<const Kernel> full_kernels() { return kernel_group<kAllEffects>(); }

}  // namespace woodcock
