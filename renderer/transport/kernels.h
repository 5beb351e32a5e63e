// The kernels of the estimator `auto`: the path loop compiled for sets of effects.
#pragma once

#include <array>
#include <span>
#include <utility>

#include "renderer/transport/path.h"
#include "renderer/world/effects.h"

namespace woodcock {

struct Kernel {
  uint32_t effects;  ///< that are compiled in
  RadianceFunction run;
};

/// All kernels; the last one has every effect.
std::span<const Kernel> kernels();

/// The kernel with the fewest effects that has all of `effects`.
const Kernel& smallest_kernel(uint32_t effects);

/// What the files of kernels give to the list.
std::span<const Kernel> surface_kernels();
std::span<const Kernel> full_kernels();

}  // namespace woodcock
