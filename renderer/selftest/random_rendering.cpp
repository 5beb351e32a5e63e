#include "renderer/selftest/random_rendering.h"

#include <algorithm>
#include <cmath>

#include "renderer/transport/features.h"

namespace woodcock::selftest {
namespace {

bool has_peak(const PhasePart& phase) {
  if (phase.kind == "mie") return true;
  if (phase.kind == "tabulated") return false;
  return std::max(std::abs(phase.g), std::abs(phase.g2)) > 0.5;
}

void allow(const MediumPart& medium, Allowance& allowed) {
  if (medium.form == MediumForm::kSum) {
    for (const MediumPart& part : medium.parts) allow(part, allowed);
    return;
  }
  const double most = std::max({medium.albedo.x, medium.albedo.y, medium.albedo.z});
  if (most > 0.9) allowed.without_roulette = false;
  if (most > 0) allowed.surfaces_only = false;
  if (has_peak(medium.phase)) allowed.uniform_directions = false;
}

}  // namespace

Allowance allowance_of(const Scene& scene) {
  Allowance allowed{true, true, true, true, true};
  if (scene.medium) allow(*scene.medium, allowed);
  for (const Body& body : scene.bodies) {
    if (body.medium) allow(*body.medium, allowed);
    const DVec3 albedo = albedo_of(body.material);
    const bool known = body.material.form <= MaterialForm::kMix;
    // Glass and the like are left for the surroundings again.
    if (!known || (std::max({albedo.x, albedo.y, albedo.z}) > 0.9 && body.material.form != MaterialForm::kInterface))
      allowed.without_roulette = false;
    if (body.material.form == MaterialForm::kSubsurface) allowed.surfaces_only = false;
    if (emission_of(scene, body) != DVec3(0)) allowed.without_mis = false;
  }
  for (const LightPart& light : scene.lights) {
    if (light.form == LightForm::kInfinite) continue;
    allowed.without_light_sampling = false;
    allowed.uniform_directions = allowed.surfaces_only = false;
  }
  return allowed;
}

Rendering random_rendering(RandomDraws& draw, const Scene& scene) {
  const Allowance allowed = allowance_of(scene);
  Rendering rendering;
  switch (draw.weighted({11, 5, 1.5, 0.7, 2})) {
    case 1: {
      const FeatureInfo& feature = kFeatures[static_cast<size_t>(draw.index(static_cast<int>(kFeatures.size())))];
      const bool may = (feature.feature != Feature::kRoulette || allowed.without_roulette) &&
                       (feature.feature != Feature::kLightSampling || allowed.without_light_sampling) &&
                       (feature.feature != Feature::kMis || allowed.without_mis);
      if (may) rendering.without = feature.name;
      break;
    }
    case 2:
      rendering.plan = false;
      break;
    case 3:
      rendering.full_kernel = true;
      break;
    case 4: {
      const char* name = draw.pick({"woodcock", "woodcock-phase", "uniform-path"});
      const bool uniform = std::string(name) == "woodcock", surfaces = std::string(name) == "uniform-path";
      if (allowed.without_light_sampling && (!uniform || allowed.uniform_directions) && (!surfaces || allowed.surfaces_only))
        rendering.estimator = name;
      break;
    }
    default:
      break;
  }
  return rendering;
}

}  // namespace woodcock::selftest
