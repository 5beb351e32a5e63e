// Light for the path loop that one smooth boundary of glass refracts.
#pragma once

#include "renderer/materials/fresnel.h"
#include "renderer/transport/path_kernel.h"

namespace woodcock {

/// In the mask of a kernel for tests: it does not find the ways through about half of each boundary. No scene calls for it, and no kernel
/// of the list has it.
inline constexpr uint32_t kMissesWays = 1u << 30;

/// Whether a kernel of this mask samples the way: not where something else may coincide with the surface, since more than one boundary
/// may be crossed there. One for tests goes by the cell of a grid that the vertex lies in.
template <uint32_t kMask>
bool is_sampled(const SurfaceInfo& surface, const Sphere& sphere, const RefractedWay& way) {
  const Vec3 p(way.v);
  for (const Box3& box : surface.overlaps)
    if (glm::all(glm::lessThanEqual(box.lower, p)) && glm::all(glm::lessThanEqual(p, box.upper))) return false;
  if constexpr ((kMask & kMissesWays) == 0) return true;
  uint64_t hash = 0;
  for (int i = 0; i < 3; ++i)
    hash = hash_combine(hash, static_cast<uint64_t>(static_cast<int64_t>(std::floor(8 * (way.v[i] - sphere.center[i]) / sphere.radius))));
  return (hash & 1) != 0;
}

template <uint32_t kMask>
template <typename Evaluate>
void PathKernel<kMask>::sample_through_glass(const DielectricSphere& body, const Lights::Choice& choice, const LightSample& light,
                                             DVec3 reference, Evaluate&& evaluate) {
  // The refraction is a scattering, too. What no ray meets by chance is left out, as it is without this technique.
  if (!may_scatter() || !light.is_bounded || light.delta) return;
  const Sphere& sphere = body.sphere;
  const SurfaceInfo& surface = world_.surfaces[static_cast<size_t>(body.shape)];
  const RefractionRoulette roulette = refraction_roulette(body);
  const RefractedWays ways = refracted_ways(sphere, static_cast<double>(body.eta), reference, light.p, roulette.longest());
  Stream tracking = stream(key_, vertex_, Purpose::kTransmittance);
  for (const RefractedWay& way : ways.all()) {
    const double length = glm::distance(way.v, reference), survives = roulette.survival(length);
    if (roulette.u >= survives || !is_sampled<kMask>(surface, sphere, way)) continue;
    const double ratio = solid_angle_ratio(way, reference, light.p, DVec3(light.n));
    const float density = static_cast<float>(static_cast<double>(choice.pmf * light.pdf) / ratio);
    if (!(density > 0) || !std::isfinite(density)) continue;
    const float transmitted = (1 - fresnel_dielectric(static_cast<float>(way.cos_i), 1 / body.eta)) * body.eta * body.eta;
    Scattered scattered;
    evaluate(Vec3(way.wi), scattered);
    const Rgb value = scattered.value * transmitted;
    if (is_black(value)) continue;
    // Outside first, since that may be hidden.
    const DVec3 n = (way.v - sphere.center) / sphere.radius;
    Ray outside{way.v + 0x1p-40 * (glm::length(way.v) + sphere.radius) * n, way.wo, ray_.time};
    const auto distance = aim(light, outside);
    if (!distance) continue;
    int medium = scattered.medium;
    Rgb transmittance{1};
    if (body.is_empty) {
      if (medium != kNone)
        transmittance =
            estimate_transmittance(world_.media[medium], {reference, way.wi, ray_.time}, length, tracking, count_, plan_.transmittance);
    } else {
      Ray inside{scattered.shadow.o, way.v - scattered.shadow.o, ray_.time};
      const double to_boundary = glm::length(inside.d);
      inside.d /= to_boundary;
      const Shadow found = shadow(inside, to_boundary * (1 - 0x1p-30), medium, {}, tracking);
      transmittance = found.transmittance;
      medium = found.medium;
    }
    if (is_black(transmittance)) continue;
    const int behind = world_.medium_after(surface, Vec3(body.flip ? -n : n), way.wo, medium);
    transmittance *=
        trace_shadow(world_, outside, *distance, behind, light.target, tracking, plan_.transmittance, uses(kPassableSurfaces), count_)
            .transmittance;
    if (is_black(transmittance)) continue;
    const float mis = power_heuristic(density, scattered.pdf);
    add(value * light.radiance * transmittance * static_cast<float>(static_cast<double>(mis / density) / survives), [&] {
      return LightAdded{.technique = Technique::kRefractedSample,
                        .source = choice.light,
                        .primitive = light.target.primitive,
                        .from = reference,
                        .wi = way.wi,
                        .p = light.p,
                        .boundary = way.v,
                        .transmittance = transmittance,
                        .source_radiance = light.radiance,
                        .density = density,
                        .weight = mis};
    });
  }
}

template <uint32_t kMask>
float PathKernel<kMask>::refraction_weight(const Refraction& refraction, const EmitterHit& emitter, int light) const {
  const DielectricSphere* body = world_.dielectric_around(refraction.from);
  if (body == nullptr || &world_.surfaces[static_cast<size_t>(body->shape)] != refraction.info) return 1;
  const Sphere& sphere = body->sphere;
  const DVec3 straight = emitter.p - refraction.from, n(emitter.ng);
  // Lights that no refraction is sampled of: inside, or seen from their other side by the straight ray.
  if (!(length_squared(emitter.p - sphere.center) > sphere.radius * sphere.radius)) return 1;
  if ((glm::dot(straight, n) > 0) != (glm::dot(ray_.d, n) > 0)) return 1;
  // As near as float directions tell two ways apart.
  constexpr double kSame = 1e-3;
  double nearest = kSame * sphere.radius, ratio = 0;
  const RefractedWays ways = refracted_ways(sphere, static_cast<double>(body->eta), refraction.from, emitter.p);
  for (const RefractedWay& way : ways.all()) {
    const double off = glm::distance(way.v, refraction.v);
    if (!(off < nearest) || !is_sampled<kMask>(*refraction.info, sphere, way)) continue;
    nearest = off;
    ratio = solid_angle_ratio(way, refraction.from, emitter.p, n);
  }
  const double sampled = static_cast<double>(world_.lights.pmf(light, refraction.from, plan_.choose_by) *
                                             world_.lights.pdf(light, refraction.from, emitter, glm::normalize(straight))) /
                         ratio;
  if (!(sampled > 0) || !std::isfinite(sampled)) return 1;
  return power_heuristic(refraction.pdf, static_cast<float>(sampled));
}

}  // namespace woodcock
