#include "renderer/transport/render_plan.h"

#include "renderer/transport/kernels.h"

namespace woodcock {
namespace {

TransmittanceOptions transmittance_options(const PathSettings& settings) {
  const auto has = [&](Feature feature) { return settings.plan && settings.features.has(feature); };
  return {.closed_forms = has(Feature::kClosedForms),
          .bricks = settings.features.has(Feature::kBricks),
          .residual = has(Feature::kResidual),
          .ray_marching = has(Feature::kRayMarchedShadows),
          .grey = settings.plan,
          .watch = settings.watch};
}

/// Without a plan nothing is known that a smaller kernel could leave out.
const Kernel& kernel_for(uint32_t effects, const PathSettings& settings) {
  return settings.full_kernel || !settings.plan ? kernels().back() : smallest_kernel(effects);
}

}  // namespace

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

RenderPlan::RenderPlan(const World& world, const PathSettings& settings)
    : max_depth(settings.max_depth),
      watch(settings.watch),
      effects(active_effects(world, settings)),
      kernel(kernel_for(effects, settings).run),
      transmittance(transmittance_options(settings)),
      choose_by(settings.features.has(Feature::kLightTree) ? ChooseBy::kArrival : ChooseBy::kPower),
      only_light(world.lights.only_choice(choose_by)),
      emission_collisions(settings.features.has(Feature::kBricks) && settings.features.has(Feature::kEmissionCollisions)),
      towards_light(settings.plan && settings.features.has(Feature::kMis) && settings.features.has(Feature::kTowardsLight) &&
                    (effects & kVolumeScattering) != 0 && (effects & kVolumeEmission) == 0),
      light_roulette(settings.features.has(Feature::kLightRoulette)),
      pieces(settings.features.has(Feature::kRectangleSampling) ? Pieces::kRectangles : Pieces::kTriangles),
      splits(settings.features.has(Feature::kSplitting) ? settings.splits : 1),
      mis(settings.features.has(Feature::kMis)),
      roulette(settings.features.has(Feature::kRoulette)),
      channel_mixture(settings.features.has(Feature::kChannelMixture)),
      layered_closed_forms(settings.features.has(Feature::kLayeredClosedForms)),
      paper(settings.paper),
      terms(settings.terms) {}

}  // namespace woodcock
