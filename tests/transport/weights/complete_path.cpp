#include "tests/transport/weights/complete_path.h"

#include <cmath>
#include <numbers>

#include "renderer/world/effects.h"

namespace woodcock::testing {

Techniques::Techniques(uint32_t effects, const PathSettings& settings) {
  const Features& on = settings.features;
  mis = on.has(Feature::kMis);
  by_power = !on.has(Feature::kLightTree);
  rectangles = on.has(Feature::kRectangleSampling);
  light_sampling = on.has(Feature::kLightSampling) && (!settings.plan || (effects & kLightSampling) != 0);
  // Both find light again that others find, so without weights they are not used; without a plan they are not either.
  equiangular = mis && settings.plan && light_sampling && on.has(Feature::kEquiangular) && (effects & kEquiangular) != 0;
  refraction = mis && settings.plan && light_sampling && on.has(Feature::kDielectricBoundaries) && (effects & kRefractedLight) != 0;
  emission_sampling = mis && settings.plan && on.has(Feature::kEmissionSampling) && (effects & kEmissionSampling) != 0;
  // Branches know nothing of emission.
  branches = mis && settings.plan && light_sampling && on.has(Feature::kTowardsLight) && (effects & kVolumeEmission) == 0;
}

Densities Densities::weights(bool mis) const {
  if (!mis) return light_sample > 0 ? Densities{0, 1, 0, 0, 0} : Densities{1, 0, 0, 0, 0};
  // Relative to the largest, so that squares stay finite.
  const double largest = std::max({scattering, light_sample, equiangular, emission_sample, refracted_sample});
  const auto square = [&](double p) { return (p / largest) * (p / largest); };
  const double all = square(scattering) + square(light_sample) + square(equiangular) + square(emission_sample) + square(refracted_sample);
  return {square(scattering) / all, square(light_sample) / all, square(equiangular) / all, square(emission_sample) / all,
          square(refracted_sample) / all};
}

namespace {

SurfaceScattering surface(const SceneFormulas& scene, const LastVertex& vertex, DVec3 wi) {
  return scatter(scene.material(vertex.material), vertex.local(vertex.wo), vertex.local(wi), vertex.closed_forms);
}

}  // namespace

double scattering_tolerance(const SceneFormulas& scene, const LastVertex& vertex, DVec3 wi) {
  return vertex.kind == LastVertex::Kind::kSurface ? surface(scene, vertex, wi).tolerance : 0;
}

std::optional<DVec3> scattering_value(const SceneFormulas& scene, const LastVertex& vertex, DVec3 wi) {
  if (vertex.kind == LastVertex::Kind::kSurface) return surface(scene, vertex, wi).value;
  return scene.medium(vertex.medium).phase(vertex.p, vertex.wo, wi).value;
}

double scattering_pdf(const SceneFormulas& scene, const LastVertex& vertex, DVec3 wi) {
  if (vertex.kind == LastVertex::Kind::kSurface) return surface(scene, vertex, wi).pdf;
  return scene.medium(vertex.medium).phase(vertex.p, vertex.wo, wi).pdf;
}

double branch_pdf(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex, DVec3 to_light, DVec3 wi) {
  // The angle to the light is uniform from 0 to π, and so is that around it.
  if (techniques.equiangular)
    return 0.5 / (std::pow(std::numbers::pi, 2) * glm::length(glm::cross(glm::normalize(to_light), glm::normalize(wi))));
  return scene.medium(vertex.medium).phase(vertex.p, -to_light, wi).pdf;
}

double branch_probability(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex) {
  if (!techniques.branches) return 0;
  if (techniques.equiangular) return vertex.scatterings_before + 1 < 3 ? 0.3 : 0;
  const double ahead = scene.medium(vertex.medium).phase(vertex.p, -vertex.wo, vertex.wo).pdf;
  if (std::abs(ahead / 0.3 - 1) < 1e-4) throw TooNear{};
  return ahead > 0.3 ? 0.15 : 0;
}

double flight_pdf(const MediumFormula& medium, DVec3 share, DVec3 p, double t) {
  const auto exponential = [&](double sigma) { return sigma * std::exp(-sigma * t); };
  if (!medium.is_homogeneous()) return exponential(medium.mean_sigma_t());
  const DVec3 sigma = medium.sigma_t(p);
  double sum = 0;
  for (int c = 0; c < 3; ++c) sum += share[c] * exponential(sigma[c]);
  return sum;
}

double equiangular_pdf(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex, int light) {
  // Only a scattering in a medium, one of the first three, has a distance that could have been drawn so.
  if (!techniques.equiangular || vertex.kind != LastVertex::Kind::kMedium || vertex.scatterings_before >= 3) return 0;
  if (!(scene.bounded_pmf(light) > 0)) return 0;
  const DVec3 to = scene.light(light).position() - vertex.o;
  const double free_paths = scene.medium(vertex.medium).mean_sigma_t() * glm::length(to);
  const double closest = glm::dot(to, vertex.d), height = std::max(glm::length(to - closest * vertex.d), 1e-6 * glm::length(to));
  const double from = std::atan(-closest / height);
  const double angle = (std::isfinite(vertex.t_max) ? std::atan((vertex.t_max - closest) / height) : std::numbers::pi / 2) - from;
  // Used for lights within 4 mean free paths that see the way under at least 0.8 radians.
  if (std::abs(free_paths - 4) < 1e-4 || std::abs(angle - 0.8) < 1e-4) throw TooNear{};
  if (free_paths > 4 || angle < 0.8) return 0;
  const double x = vertex.t - closest;
  return scene.bounded_pmf(light) * height / (angle * (height * height + x * x));
}

std::optional<Crossing> cross(const Body& glass, DVec3 from, DVec3 w) {
  Crossing c;
  c.v = from + glass.chord(from, w).second * w;
  if (glass.sphere) {
    c.n = glm::normalize(c.v - glass.center);
  } else {
    // The nearest face, of those that the ray may leave by.
    double nearest = 1e300;
    for (int i = 0; i < 3; ++i) {
      const double off = std::abs(c.v[i] - (w[i] > 0 ? glass.upper : glass.lower)[i]);
      if (w[i] == 0 || off >= nearest) continue;
      nearest = off;
      c.n = DVec3(0);
      c.n[i] = w[i] > 0 ? 1 : -1;
    }
  }
  c.cos_i = glm::dot(w, c.n);
  const DVec3 across = glass.eta * (w - c.cos_i * c.n);
  const double rest = 1 - glm::dot(across, across);
  if (rest <= 0) return std::nullopt;
  c.cos_t = std::sqrt(rest);
  c.wo = across + c.cos_t * c.n;
  return c;
}

namespace {

/// Per steradian of the direction wi: that of the point on the light, drawn as if there was no glass, by area, times the area that a bundle
/// of rays around wi covers there by its solid angle.
double refracted_pdf(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex, const LightEnd& end) {
  const LightFormula& light = scene.light(end.source);
  const Body* glass = scene.glass_around(vertex.p);
  if (glass == nullptr || light.is_delta()) return 0;
  const double inside = glass->depth(end.p);
  if (std::abs(inside) < 1e-6) throw TooNear{};
  if (inside > 0) return 0;
  const DVec3 n = light.normal(end.primitive, end.p), straight = end.p - vertex.p, w = glm::normalize(straight);
  const DVec3 s = glm::normalize(glm::cross(end.wi, std::abs(end.wi.x) < 0.5 ? DVec3(1, 0, 0) : DVec3(0, 1, 0))), t = glm::cross(end.wi, s);
  constexpr double kStep = 1e-6;
  const auto met = cross(*glass, vertex.p, end.wi);
  if (!met) throw TooNear{};
  const auto arrive = [&](double ds, double dt) {
    const auto c = cross(*glass, vertex.p, glm::normalize(end.wi + ds * s + dt * t));
    if (!c || glm::dot(c->n, met->n) < 0.5) throw TooNear{};
    return c->v + glm::dot(end.p - c->v, n) / glm::dot(c->wo, n) * c->wo;
  };
  const double side = glm::dot(w, n), refracted_side = glm::dot(met->wo, n);
  if (std::abs(side) < 1e-5 || std::abs(refracted_side) < 1e-5) throw TooNear{};
  if ((side > 0) != (refracted_side > 0)) return 0;
  const DVec3 by_s = (arrive(kStep, 0) - arrive(-kStep, 0)) / (2 * kStep), by_t = (arrive(0, kStep) - arrive(0, -kStep)) / (2 * kStep);
  const double area = glm::length(glm::cross(by_s, by_t));
  // On a caustic the bundle covers none. Near it two ways meet, and where a direction in float ends says little of which way it was: at
  // 0.002 of the free bundle they were moved by a third of their distance, which shrinks with the square.
  if (area < 1e-2 * glm::dot(straight, straight)) throw TooNear{};
  const double by_area =
      light.pdf(vertex.p, end.primitive, end.p, w, techniques.rectangles) * std::abs(side) / glm::dot(straight, straight);
  return scene.pmf(end.source, vertex.p, techniques.by_power) * by_area * area;
}

}  // namespace

Densities densities(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex, const LightEnd& end) {
  // What the camera sees, and what a delta lobe leads to, is found in one way.
  if (vertex.kind == LastVertex::Kind::kCamera || end.by_delta_lobe) return {1, 0, 0, 0, 0};
  const bool samples = vertex.kind == LastVertex::Kind::kMedium || !is_delta(scene.material(vertex.material));
  Densities all;
  all.scattering = scattering_pdf(scene, vertex, end.wi);
  if (end.kind == LightEnd::Kind::kEmission) {
    const MediumFormula& medium = scene.medium(end.source);
    all.scattering *= medium.typical_rate();
    const DVec3 to = end.p - vertex.p;
    if (samples && techniques.emission_sampling && medium.samples_emission())
      all.emission_sample = scene.emissive_pmf(end.source) * medium.emission_pdf(end.p) * glm::dot(to, to);
    return all;
  }
  const double flown =
      vertex.kind == LastVertex::Kind::kMedium ? flight_pdf(scene.medium(vertex.medium), vertex.share, vertex.p, vertex.t) : 1;
  all.scattering *= flown;
  if (end.kind == LightEnd::Kind::kEnvironment) {
    // Skies are constant here: they are never sampled.
    return all;
  }
  const LightFormula& light = scene.light(end.source);
  if (end.refracted) {
    if (samples && techniques.refraction) all.refracted_sample = flown * refracted_pdf(scene, techniques, vertex, end);
    return all;
  }
  if (light.is_delta()) all.scattering = 0;
  const double to_light = light.pdf(vertex.p, end.primitive, end.p, end.wi, techniques.rectangles);
  if (samples && techniques.light_sampling) all.light_sample = flown * scene.pmf(end.source, vertex.p, techniques.by_power) * to_light;
  if (to_light > 0) all.equiangular = equiangular_pdf(scene, techniques, vertex, end.source) * to_light;
  return all;
}

}  // namespace woodcock::testing
