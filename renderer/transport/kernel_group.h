// How a file of kernels makes its part of the list.
#pragma once

#include "renderer/transport/kernels.h"
#include "renderer/transport/path_kernel.h"
#include "renderer/transport/path_kernel_light.h"
#include "renderer/transport/path_kernel_media.h"
#include "renderer/transport/path_kernel_refraction.h"
#include "renderer/transport/path_kernel_surface.h"

namespace woodcock {

/// One path by the kernel of `kMask`.
template <uint32_t kMask>
PathResult run_kernel(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count) {
  ++count.paths;
  PathSample sample{world, plan, count};
  return PathKernel<kMask>(sample, ray, key).run();
}

/// The kernels of these sets of effects.
template <uint32_t... kMasks>
std::span<const Kernel> kernel_group() {
  static constexpr std::array<Kernel, sizeof...(kMasks)> kGroup{{{kMasks, &run_kernel<kMasks>}...}};
  return kGroup;
}

inline constexpr uint32_t kDiffuse = kSurfaces | kLightSampling;
inline constexpr uint32_t kAnySurface = kSurfaces | kGeneralSurfaces | kLightSampling;

}  // namespace woodcock
