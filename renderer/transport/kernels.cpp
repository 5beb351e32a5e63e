#include "renderer/transport/kernels.h"

#include <bit>
#include <vector>

namespace woodcock {

std::span<const Kernel> kernels() {
  static const std::vector<Kernel> all = [] {
    std::vector<Kernel> list;
    for (const auto part : {surface_kernels(), full_kernels()}) list.insert(list.end(), part.begin(), part.end());
    return list;
  }();
  return all;
}

uint32_t active_effects(const World& world, const PathSettings& settings) {
  // The general algorithm knows of no scene that makes these worth while.
  constexpr uint32_t kByAnalysis = kEquiangular | kEmissionSampling | kRefractedLight;
  uint32_t effects = settings.plan ? world.effects : kAllEffects & ~kByAnalysis;
  const Features& features = settings.features;
  if (!features.has(Feature::kEquiangular)) effects &= ~kEquiangular;
  if (!features.has(Feature::kEmissionSampling)) effects &= ~kEmissionSampling;
  if (!features.has(Feature::kDielectricBoundaries)) effects &= ~kRefractedLight;
  if (!features.has(Feature::kLightSampling)) effects &= ~(kLightSampling | kEquiangular | kRefractedLight);
  // They find again what others find, and are right only when weighted against them.
  if (!features.has(Feature::kMis)) effects &= ~(kEquiangular | kEmissionSampling | kRefractedLight);
  return effects;
}

const Kernel& smallest_kernel(uint32_t effects) {
  const std::span<const Kernel> all = kernels();
  const Kernel* best = &all.back();
  for (const Kernel& k : all) {
    if ((k.effects & effects) == effects && std::popcount(k.effects) < std::popcount(best->effects)) best = &k;
  }
  return *best;
}

}  // namespace woodcock
