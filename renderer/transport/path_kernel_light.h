// Light for the path loop: sampled, met by chance, and scattered once on the way.
#pragma once

#include "renderer/transport/path_kernel.h"

namespace woodcock {

template <uint32_t kMask>
std::optional<double> PathKernel<kMask>::aim(const LightSample& light, Ray& ray) {
  if (!light.is_bounded) return static_cast<double>(kInf);
  const DVec3 to = light.p - ray.o;
  const double distance = glm::length(to);
  if (!(distance > 0)) return std::nullopt;
  ray.d = to / distance;
  if (light.target.shape == kNone) return distance;
  // How far the start lies on the drawn side, and what rounding makes of both points.
  const DVec3 n(light.n);
  const double ahead = glm::dot(n, to) * (glm::dot(light.n, light.wi) > 0 ? 1 : -1);
  if (!(ahead > 0x1p-40 * glm::dot(glm::abs(n), glm::abs(light.p) + glm::abs(ray.o)))) return std::nullopt;
  return distance;
}

template <uint32_t kMask>
template <typename Evaluate>
void PathKernel<kMask>::sample_light(DVec3 reference, Evaluate&& evaluate) {
  const auto choice = plan_.only_light
                          ? plan_.only_light
                          : world_.lights.choose(stream(key_, vertex_, Purpose::kLightChoice).uniform_double(), reference, plan_.choose_by);
  if (!choice) return;
  const DielectricSphere* sphere = uses(kRefractedLight) ? world_.dielectric_around(reference) : nullptr;
  // Where nothing is inside, every light is outside.
  if (sphere != nullptr && sphere->is_empty && !survives_refraction(*sphere, reference)) return;
  if (uses(kRefractedLight) && sphere == nullptr && !survives_refraction_by_mesh(reference)) return;
  Stream random = stream(key_, vertex_, Purpose::kLightSample);
  const Vec2 u = random.uniform2();
  const auto light = world_.lights.sample(choice->light, reference, u, random.uniform_double(), plan_.choose_by, plan_.pieces);
  if (!light || is_black(light->radiance)) return;
  if constexpr ((kMask & kVolumeScattering) != 0) light_direction_ = light->wi;
  if (uses(kRefractedLight)) {
    const DVec3 to = light->is_bounded ? light->p - reference : DVec3(light->wi);
    const double length = glm::length(to);
    const Glass glass = glass_towards(sphere, reference, to / length, light->is_bounded ? length : static_cast<double>(kInf));
    if (glass.sphere != nullptr || glass.mesh) return sample_through_glass(glass, *choice, *light, reference, evaluate);
  }
  Scattered scattered;
  evaluate(light->wi, scattered);
  if (is_black(scattered.value)) return;
  const float survival = light_survival(scattered);
  if (survival < 1 && random.uniform_double() >= static_cast<double>(survival)) return;
  const auto distance = aim(*light, scattered.shadow);
  if (!distance) return;
  Stream tracking = stream(key_, vertex_, Purpose::kTransmittance);
  const Rgb transmittance = shadow(scattered.shadow, *distance, scattered.medium, light->target, tracking).transmittance;
  if (is_black(transmittance)) return;
  const float light_pdf = choice->pmf * light->pdf;
  const float mis =
      plan_.mis ? power_heuristic(light_pdf, light->delta ? 0 : scattered.pdf, equiangular_odds(choice->light) * light->pdf) : 1;
  add(scattered.value * light->radiance * transmittance * (mis / (light_pdf * survival)), [&] {
    return LightAdded{.technique = Technique::kLightSample,
                      .source = choice->light,
                      .primitive = light->target.primitive,
                      .from = reference,
                      .wi = light->wi,
                      .p = light->p,
                      .transmittance = transmittance,
                      .source_radiance = light->radiance,
                      .density = light_pdf,
                      .weight = mis};
  });
}

template <uint32_t kMask>
template <typename Evaluate>
void PathKernel<kMask>::sample_emission(DVec3 reference, Evaluate&& evaluate) {
  if (world_.emissive_media.empty()) return;
  Stream random = stream(key_, vertex_, Purpose::kEmission);
  const Vec2 u = random.uniform2();
  const int chosen = world_.choose_emissive(random.uniform_double());
  const Medium& medium = world_.media[chosen];
  const float u_z = random.uniform();
  const auto brick = medium.emission_importance()->sample({u.x, u.y, u_z}, random.uniform_double());
  DVec3 to = brick.p - reference;
  double distance = glm::length(to);
  if (!(distance > 0)) return;
  ++count_.emission_lookups;
  const Rgb emission = sample_.look_up(medium, brick.p).emission;
  if (is_black(emission)) return;
  Scattered scattered;
  evaluate(Vec3(to / distance), scattered);
  if (is_black(scattered.value)) return;
  const float density = world_.emissive_pmf(chosen) * brick.pdf * static_cast<float>(distance * distance);
  to = brick.p - scattered.shadow.o;
  distance = glm::length(to);
  if (!(distance > 0)) return;
  scattered.shadow.d = to / distance;
  const Shadow found = shadow(scattered.shadow, distance, scattered.medium, {}, random);
  if (found.medium != chosen || is_black(found.transmittance)) return;
  const float mis = power_heuristic(density, scattered.pdf * typical_rate(medium));
  add(scattered.value * emission * found.transmittance * (mis / density), [&] {
    return LightAdded{.technique = Technique::kEmissionSample,
                      .source = chosen,
                      .from = reference,
                      .wi = glm::normalize(brick.p - reference),
                      .p = brick.p,
                      .transmittance = found.transmittance,
                      .source_radiance = emission,
                      .density = density,
                      .weight = mis};
  });
}

template <uint32_t kMask>
void PathKernel<kMask>::add_emission(const Hit& hit, const SurfacePoint& s, int light) {
  const EmitterHit emitter{s.p, s.ng, s.uv, hit.primitive, hit.uv};
  const Rgb radiance = world_.lights.emitted(light, emitter, Vec3(-ray_.d));
  if (is_black(radiance)) return;
  float mis = 1;
  if (uses(kLightSampling) && direction_pdf_ > 0) {
    const float light_pdf = world_.lights.pdf(light, reference_, emitter, ray_.d, plan_.pieces);
    const float sampled = world_.lights.pmf(light, reference_, plan_.choose_by) * light_pdf;
    mis = plan_.mis ? power_heuristic(direction_pdf_, sampled, equiangular_odds(light) * light_pdf) : sampled > 0 ? 0 : 1;
  } else if (uses(kRefractedLight) && refraction_) {
    mis = refraction_weight(*refraction_, emitter, light);
  }
  add(radiance * mis, [&] {
    return LightAdded{.technique = Technique::kScattering,
                      .source = light,
                      .primitive = hit.primitive,
                      .from = reference_,
                      .wi = ray_.d,
                      .p = s.p,
                      .source_radiance = radiance,
                      .weight = mis};
  });
}

template <uint32_t kMask>
void PathKernel<kMask>::add_environment() {
  if (!world_.lights.has_environment()) return;
  float mis = 1;
  if (uses(kLightSampling) && direction_pdf_ > 0) {
    const float sampled = world_.lights.environment_pdf(ray_.d, reference_, plan_.choose_by);
    mis = plan_.mis ? power_heuristic(direction_pdf_, sampled) : sampled > 0 ? 0 : 1;
  }
  const Rgb radiance = world_.lights.environment(ray_.d);
  add(radiance * mis, [&] {
    return LightAdded{.technique = Technique::kEnvironment, .from = reference_, .wi = ray_.d, .source_radiance = radiance, .weight = mis};
  });
}

template <uint32_t kMask>
void PathKernel<kMask>::sample_equiangular(const Medium& medium, double t_max) {
  const double u_distance = equiangular_.uniform_double();
  const auto choice = world_.lights.choose_bounded(equiangular_.uniform_double());
  if (!choice) return;
  const DVec3 position = world_.lights.position(choice->light);
  if (!is_near(medium, ray_.o, position)) return;
  const EquiangularDistances distances(ray_, position, t_max);
  if (distances.angle() < kMinAngle) return;
  const double t = distances.sample(u_distance);
  const float pdf = distances.pdf(t);
  const DVec3 p = ray_.at(t);
  const Vec2 u = equiangular_.uniform2();
  const auto light = world_.lights.sample(choice->light, p, u, equiangular_.uniform_double(), plan_.choose_by, plan_.pieces);
  if (!(pdf > 0) || !(t < t_max) || !light || is_black(light->radiance)) return;
  const MediumPoint m = sample_.look_up(medium, p);
  const PhaseMix phase = medium.phase_at(p);
  const Vec3 wo(-ray_.d);
  Ray ray{p, light->wi, ray_.time};
  if (is_black(m.sigma_s)) return;
  const auto distance = aim(*light, ray);
  if (!distance) return;
  const Rgb to_light = shadow(ray, *distance, medium_, light->target, equiangular_).transmittance;
  if (is_black(to_light)) return;
  const Rgb to_point = estimate_transmittance(medium, ray_, t, equiangular_, count_, plan_.transmittance);
  const float density = pdf * choice->pmf * light->pdf, flown = flight_density(medium, shares(), t);
  const float mis = power_heuristic(density, flown * world_.lights.pmf(choice->light, p, plan_.choose_by) * light->pdf,
                                    light->delta ? 0 : flown * phase.pdf(wo, light->wi));
  add(m.sigma_s * phase.eval(wo, light->wi) * light->radiance * to_point * to_light * (next_light_share_ * mis / density), [&] {
    return LightAdded{.technique = Technique::kEquiangular,
                      .source = choice->light,
                      .primitive = light->target.primitive,
                      .from = p,
                      .wi = light->wi,
                      .p = light->p,
                      .t = t,
                      .transmittance = to_point * to_light,
                      .source_radiance = light->radiance,
                      .density = density,
                      .weight = mis};
  });
}

template <uint32_t kMask>
float PathKernel<kMask>::flight_density(const Medium& medium, Rgb share, double t) const {
  const auto density = [&](double sigma) { return sigma * std::exp(-sigma * t); };
  double sum = 0;
  if (!medium.is_homogeneous() || !is_chromatic(medium)) {
    sum = density(medium.is_homogeneous() ? static_cast<double>(medium.homogeneous().sigma_t.x) : medium.mean_sigma_t());
  } else {
    for (int c = 0; c < 3; ++c) sum += static_cast<double>(share[c]) * density(static_cast<double>(medium.homogeneous().sigma_t[c]));
  }
  return std::max(static_cast<float>(sum), 1e-30f);
}

template <uint32_t kMask>
float PathKernel<kMask>::equiangular_odds(int light) const {
  if (!uses(kEquiangular) || !last_flight_) return 0;
  const FlightSegment& flight = *last_flight_;
  const float pmf = world_.lights.bounded_pmf(light);
  const Medium& medium = world_.media[flight.medium];
  const DVec3 position = world_.lights.position(light);
  if (!(pmf > 0) || !is_near(medium, flight.ray.o, position)) return 0;
  const EquiangularDistances distances(flight.ray, position, flight.t_max);
  if (distances.angle() < kMinAngle) return 0;
  return pmf * distances.pdf(flight.t) / flight_density(medium, flight.share, flight.t);
}

}  // namespace woodcock
