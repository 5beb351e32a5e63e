// Light for the path loop that one smooth boundary of glass refracts.
#pragma once

#include "renderer/materials/fresnel.h"
#include "renderer/transport/path_kernel.h"

namespace woodcock {

/// In the mask of a kernel for tests: it does not find the ways through about half of each boundary. No scene calls for it, and no kernel
/// of the list has it.
inline constexpr uint32_t kMissesWays = 1u << 30;

/// Whether a kernel of this mask finds the way. One for tests goes by the cell of a grid, eight to the `size` of the body, that the vertex
/// lies in.
template <uint32_t kMask>
bool is_found(DVec3 v, DVec3 center, double size) {
  if constexpr ((kMask & kMissesWays) == 0) return true;
  uint64_t hash = 0;
  for (int i = 0; i < 3; ++i)
    hash = hash_combine(hash, static_cast<uint64_t>(static_cast<int64_t>(std::floor(8 * (v[i] - center[i]) / size))));
  return (hash & 1) != 0;
}

/// Whether something else may coincide with the surface at v.
inline bool may_overlap_at(const SurfaceInfo& surface, DVec3 v) {
  const Vec3 p(v);
  return std::any_of(surface.overlaps.begin(), surface.overlaps.end(), [&](const Box3& box) {
    return glm::all(glm::lessThanEqual(box.lower, p)) && glm::all(glm::lessThanEqual(p, box.upper));
  });
}

/// Whether a way through a sphere is sampled: not where something else may coincide with it, since more than one boundary may be crossed
/// there.
template <uint32_t kMask>
bool is_sampled(const SurfaceInfo& surface, const Sphere& sphere, const RefractedWay& way) {
  return !may_overlap_at(surface, way.v) && is_found<kMask>(way.v, sphere.center, sphere.radius);
}

template <uint32_t kMask>
bool PathKernel<kMask>::is_alone(const MeshWay& found, DVec3 from) const {
  // Large meshes may touch themselves as far as contacts tell.
  if (!may_overlap_at(world_.surfaces[static_cast<size_t>(found.hit.shape)], found.way.v)) return true;
  Hit hit = found.hit;
  hit.t = glm::distance(found.way.v, from);
  std::array<CoincidentHit, 2> met;
  return world_.geometry.coincident({from, found.way.wi, ray_.time}, hit, met) <= 1;
}

template <uint32_t kMask>
typename PathKernel<kMask>::Glass PathKernel<kMask>::glass_towards(const DielectricSphere* sphere, DVec3 from, DVec3 d,
                                                                   double distance) const {
  // A little short of the light, which may touch the glass.
  constexpr double kShort = 1 - 1e-6;
  std::optional<double> end;
  if (sphere != nullptr) {
    const DVec3 o = from - sphere->sphere.center;
    const double b = glm::dot(o, d), r = sphere->sphere.radius;
    end = std::sqrt(std::max(0.0, b * b + (r * r - length_squared(o)))) - b;
  }
  if (!world_.dielectric_meshes.empty() && (sphere == nullptr || !sphere->is_empty)) {
    if (const auto exit = world_.dielectric_meshes.exit_towards(from, d, std::min(kShort * distance, end.value_or(kInf))))
      return {nullptr, exit};
  }
  if (end && *end < distance) return {sphere, std::nullopt};
  return {};
}

template <uint32_t kMask>
typename PathKernel<kMask>::RefractionRoulette PathKernel<kMask>::refraction_roulette(bool is_empty) const {
  const bool closed = is_empty && medium_ != kNone && world_.media[medium_].is_homogeneous() && plan_.transmittance.closed_forms;
  return {stream(key_, vertex_, Purpose::kRefraction).uniform_double(),
          closed ? static_cast<double>(min_component(world_.media[medium_].homogeneous().sigma_t)) : 0};
}

template <uint32_t kMask>
bool PathKernel<kMask>::survives_refraction(const DielectricSphere& body, DVec3 from) const {
  const RefractionRoulette roulette = refraction_roulette(body.is_empty);
  return may_scatter() && roulette.u < roulette.survival(body.sphere.radius - glm::length(from - body.sphere.center));
}

template <uint32_t kMask>
bool PathKernel<kMask>::survives_refraction_by_mesh(DVec3 from) const {
  if (world_.dielectric_meshes.empty()) return true;
  const double depth = world_.dielectric_meshes.depth(from);
  if (!(depth > 0)) return true;
  const RefractionRoulette roulette = refraction_roulette(true);
  return may_scatter() && roulette.u < roulette.survival(depth);
}

template <uint32_t kMask>
double PathKernel<kMask>::solid_angle_ratio(const RefractedWay& way, DVec3 from, DVec3 p, DVec3 n) {
  const DVec3 straight = p - from;
  const double d2 = length_squared(straight);
  return way.solid_angle_per_area * std::abs(glm::dot(way.wo, n)) * d2 * std::sqrt(d2) / std::abs(glm::dot(straight, n));
}

template <uint32_t kMask>
template <typename Evaluate>
void PathKernel<kMask>::sample_through_glass(const Glass& glass, const Lights::Choice& choice, const LightSample& light, DVec3 reference,
                                             Evaluate&& evaluate) {
  // The refraction is a scattering, too. What no ray meets by chance is left out, as it is without this technique.
  if (!may_scatter() || !light.is_bounded || light.delta) return;
  Stream tracking = stream(key_, vertex_, Purpose::kTransmittance);
  if (glass.mesh) {
    const DielectricMeshes::Body& body = *glass.mesh->body;
    const RefractionRoulette roulette = refraction_roulette(true);
    const MeshWays ways = world_.dielectric_meshes.ways(*glass.mesh, reference, light.p);
    for (const MeshWay& found : ways.all()) {
      const SurfaceInfo& surface = world_.surfaces[static_cast<size_t>(found.hit.shape)];
      const double survives = roulette.survival(glm::distance(found.way.v, reference));
      if (roulette.u >= survives || !is_found<kMask>(found.way.v, body.lower, 0.5 * body.size()) || !is_alone(found, reference)) continue;
      const SurfacePoint s = world_.geometry.surface(found.hit, ray_, Geometry::Tangents::kNotWanted);
      add_refracted({found.way, surface, body.eta, s.ng, offset_origin(s, found.way.wo), body.is_clear, survives}, choice, light, reference,
                    tracking, evaluate);
    }
    return;
  }
  const DielectricSphere& body = *glass.sphere;
  const Sphere& sphere = body.sphere;
  const SurfaceInfo& surface = world_.surfaces[static_cast<size_t>(body.shape)];
  const RefractionRoulette roulette = refraction_roulette(body.is_empty);
  const RefractedWays ways = refracted_ways(sphere, static_cast<double>(body.eta), reference, light.p, roulette.longest());
  for (const RefractedWay& way : ways.all()) {
    const double survives = roulette.survival(glm::distance(way.v, reference));
    if (roulette.u >= survives || !is_sampled<kMask>(surface, sphere, way)) continue;
    const DVec3 n = (way.v - sphere.center) / sphere.radius;
    add_refracted({way, surface, body.eta, Vec3(body.flip ? -n : n), way.v + 0x1p-40 * (glm::length(way.v) + sphere.radius) * n,
                   body.is_empty, survives},
                  choice, light, reference, tracking, evaluate);
  }
}

template <uint32_t kMask>
template <typename Evaluate>
void PathKernel<kMask>::add_refracted(const WayThrough& through, const Lights::Choice& choice, const LightSample& light, DVec3 reference,
                                      Stream& tracking, Evaluate&& evaluate) {
  const RefractedWay& way = through.way;
  const double ratio = solid_angle_ratio(way, reference, light.p, DVec3(light.n));
  const float density = static_cast<float>(static_cast<double>(choice.pmf * light.pdf) / ratio);
  if (!(density > 0) || !std::isfinite(density)) return;
  const float transmitted = (1 - fresnel_dielectric(static_cast<float>(way.cos_i), 1 / through.eta)) * through.eta * through.eta;
  Scattered scattered;
  evaluate(Vec3(way.wi), scattered);
  const Rgb value = scattered.value * transmitted;
  if (is_black(value)) return;
  // Outside first, since that may be hidden.
  Ray outside{through.outside, way.wo, ray_.time};
  const auto distance = aim(light, outside);
  if (!distance) return;
  int medium = scattered.medium;
  Rgb transmittance{1};
  if (through.is_empty) {
    if (medium != kNone)
      transmittance = estimate_transmittance(world_.media[medium], {reference, way.wi, ray_.time}, glm::distance(way.v, reference),
                                             tracking, count_, plan_.transmittance);
  } else {
    Ray inside{scattered.shadow.o, way.v - scattered.shadow.o, ray_.time};
    const double to_boundary = glm::length(inside.d);
    inside.d /= to_boundary;
    const Shadow found = shadow(inside, to_boundary * (1 - 0x1p-30), medium, {}, tracking);
    transmittance = found.transmittance;
    medium = found.medium;
  }
  if (is_black(transmittance)) return;
  const int behind = world_.medium_after(through.surface, through.ng, way.wo, medium);
  transmittance *=
      trace_shadow(world_, outside, *distance, behind, light.target, tracking, plan_.transmittance, uses(kTransparentSurfaces), count_)
          .transmittance;
  if (is_black(transmittance)) return;
  const float mis = power_heuristic(density, scattered.pdf);
  add(value * light.radiance * transmittance * static_cast<float>(static_cast<double>(mis / density) / through.survives), [&] {
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

template <uint32_t kMask>
float PathKernel<kMask>::refraction_weight(const Refraction& refraction, const EmitterHit& emitter, int light) const {
  const DVec3 straight = emitter.p - refraction.from, n(emitter.ng);
  // Lights that no refraction is sampled of: seen from their other side by the straight ray, or not outside of this surface.
  if ((glm::dot(straight, n) > 0) != (glm::dot(ray_.d, n) > 0)) return 1;
  const double distance = glm::length(straight);
  const Glass glass = glass_towards(world_.dielectric_around(refraction.from), refraction.from, straight / distance, distance);
  double ratio = 0;
  // The way that was met, as near as float directions tell two ways apart.
  constexpr double kSame = 1e-3;
  const auto compare = [&](const RefractedWay& way, double& nearest) {
    const double off = glm::distance(way.v, refraction.v);
    if (!(off < nearest)) return;
    nearest = off;
    ratio = solid_angle_ratio(way, refraction.from, emitter.p, n);
  };
  if (glass.mesh) {
    const DielectricMeshes::Body& body = *glass.mesh->body;
    const MeshWays ways = world_.dielectric_meshes.ways(*glass.mesh, refraction.from, emitter.p);
    double nearest = kSame * body.size();
    for (const MeshWay& found : ways.all()) {
      const Hit &a = found.hit, &b = refraction.hit;
      if (found.is_flat && (a.shape != b.shape || a.primitive != b.primitive || a.instance != b.instance)) continue;
      if (is_found<kMask>(found.way.v, body.lower, 0.5 * body.size()) && is_alone(found, refraction.from)) compare(found.way, nearest);
    }
  } else if (glass.sphere != nullptr && &world_.surfaces[static_cast<size_t>(glass.sphere->shape)] == refraction.info) {
    const Sphere& sphere = glass.sphere->sphere;
    double nearest = kSame * sphere.radius;
    const RefractedWays ways = refracted_ways(sphere, static_cast<double>(glass.sphere->eta), refraction.from, emitter.p);
    for (const RefractedWay& way : ways.all())
      if (is_sampled<kMask>(*refraction.info, sphere, way)) compare(way, nearest);
  }
  if (!(ratio > 0)) return 1;
  const double sampled = static_cast<double>(world_.lights.pmf(light, refraction.from, plan_.choose_by) *
                                             world_.lights.pdf(light, refraction.from, emitter, straight / distance, plan_.pieces)) /
                         ratio;
  if (!(sampled > 0) || !std::isfinite(sampled)) return 1;
  return power_heuristic(refraction.pdf, static_cast<float>(sampled));
}

}  // namespace woodcock
