// The path loop in media: free flight, tracking, scattering.
#pragma once

#include "renderer/transport/path_kernel.h"
#include "renderer/transport/path_kernel_towards_light.h"

namespace woodcock {

/// j (1 − exp(−σ t))/σ per channel: what a segment of length t emits towards its start; j t where nothing dims it.
inline Rgb segment_emission(Rgb j, Rgb sigma, double t) {
  Rgb result{0};
  for (int c = 0; c < 3; ++c) {
    const double sigma_c = sigma[c], j_c = j[c];
    if (j[c] > 0) result[c] = static_cast<float>(sigma[c] > 0 ? -std::expm1(-sigma_c * t) * (j_c / sigma_c) : j_c * t);
  }
  return result;
}

template <uint32_t kMask>
inline std::optional<Hit> PathKernel<kMask>::find_hit() {
  drawn_.reset();
  no_hit_until_ = kInf;
  if (uses(kRefractedLight) && uses(kHomogeneousMedia) && medium_ != kNone) {
    const DielectricSphere* body = world_.dielectric_around(ray_.o);
    if (body != nullptr && body->is_empty && draws_before_hit(world_.media[medium_])) {
      drawn_ = draw_flight(world_.media[medium_].homogeneous(), is_chromatic(world_.media[medium_]));
      if (body->holds(ray_.o) && body->holds(ray_.at(drawn_->t))) {
        no_hit_until_ = std::nextafter(drawn_->t, static_cast<double>(kInf));
        return std::nullopt;
      }
    }
  }
  return Base::find_hit();
}

template <uint32_t kMask>
inline bool PathKernel<kMask>::draws_before_hit(const Medium& medium) const {
  return medium.is_homogeneous() && plan_.transmittance.closed_forms && has_closed_forms(medium.homogeneous()) && uses(kVolumeScattering) &&
         medium.scatters() && may_scatter() && !(uses(kVolumeEmission) && medium.emits()) &&
         !(uses(kEquiangular) && vertex_ < kEquiangularVertices);
}

template <uint32_t kMask>
inline FlightEnd PathKernel<kMask>::cross_medium(const std::optional<Hit>& hit) {
  const auto t = sample_distance(hit ? hit->t : no_hit_until_);
  if (ended_) return FlightEnd::kOver;
  note([&] { return SegmentEnds{t, beta_}; });
  if (!t) {
    next_light_share_ = 1;
    return FlightEnd::kThrough;
  }
  return scatter_in_medium(*t, point_before(world_, ray_, *t, hit, uses(kTouching))) ? FlightEnd::kScattered : FlightEnd::kOver;
}

template <uint32_t kMask>
inline std::optional<double> PathKernel<kMask>::sample_distance(double t_max) {
  const Medium& medium = world_.media[medium_];
  note([&] { return SegmentStarts{ray_.o, ray_.d, t_max, medium_, beta_}; });
  if (uses(kEquiangular)) {
    this_flight_ = {ray_, t_max, 0, medium_, shares()};
    if (vertex_ < kEquiangularVertices && medium.scatters() && may_scatter()) sample_equiangular(medium, t_max);
  }
  if (uses(kHomogeneousMedia) && medium.is_homogeneous() && (plan_.transmittance.closed_forms || !std::isfinite(t_max)) &&
      has_closed_forms(medium.homogeneous()))
    return sample_distance_homogeneous(medium.homogeneous(), is_chromatic(medium), t_max);
  if (uses(kHeterogeneousMedia) && !medium.parts().empty() && !medium.is_homogeneous()) {
    if (const auto unbounded = unbounded_part(medium, ray_, t_max)) return sample_distance_unbounded(medium, *unbounded);
  }
  return track(medium, t_max);
}

template <uint32_t kMask>
std::optional<double> PathKernel<kMask>::sample_distance_homogeneous(const MediumPoint& m, bool chromatic, double t_max) {
  if (uses(kVolumeEmission) && !is_black(m.emission)) {
    add(segment_emission(m.emission, m.sigma_t, t_max),
        [&] { return LightAdded{.technique = Technique::kSegment, .source = medium_, .length = t_max}; });
  }
  if (!uses(kVolumeScattering) || is_black(m.sigma_s) || !may_scatter()) {
    beta_ *= attenuation(m.sigma_t, t_max);
    ended_ = is_black(beta_);
    return std::nullopt;
  }
  const auto [t, hero] = drawn_ ? *std::exchange(drawn_, std::nullopt) : draw_flight(m, chromatic);
  const bool through = t >= t_max;
  if (!chromatic) {
    if (through) return std::nullopt;
    beta_ *= m.sigma_s / m.sigma_t.x;
    return t;
  }
  const Rgb share = shares();
  const float hero_sigma = m.sigma_t[hero];
  // Transmittances relative to the hero's: exp(−(σt − σt_hero) t), formed in the exponent so that the ratio of two
  // numbers too small for a float is right.
  Rgb relative{1};
  for (int c = 0; c < 3; ++c) {
    if (m.sigma_t[c] != hero_sigma)
      relative[c] = static_cast<float>(std::exp(static_cast<double>(hero_sigma - m.sigma_t[c]) * std::min(t, t_max)));
  }
  const Rgb value = through ? relative : relative * m.sigma_s, density = through ? relative : relative * m.sigma_t;
  const float mixture = glm::dot(share, density);
  beta_ *= mixture > 0 ? value / mixture : Rgb(0);
  ended_ = is_black(beta_);
  if (through) return std::nullopt;
  return t;
}

template <uint32_t kMask>
std::optional<double> PathKernel<kMask>::sample_distance_unbounded(const Medium& medium, const UnboundedPart& unbounded) {
  if (const auto t = track(medium, unbounded.from); t || ended_) return t;
  if (uses(kVolumeScattering) && may_scatter() && !has_closed_forms(unbounded.point)) return add_infinite_radiance();
  if (is_black(beta_)) {
    ended_ = true;
    return std::nullopt;
  }
  const auto beyond = sample_distance_homogeneous(unbounded.point, is_chromatic(medium), kInf);
  if (!beyond) return std::nullopt;
  return unbounded.from + *beyond;
}

template <uint32_t kMask>
std::optional<double> PathKernel<kMask>::track(const Medium& medium, double t_max) {
  const bool scatters = uses(kVolumeScattering) && medium.scatters() && may_scatter();
  const bool emits = uses(kVolumeEmission) && medium.emits();
  if (!scatters && !emits) {
    beta_ *= estimate_transmittance(medium, ray_, t_max, flight_, count_, plan_.transmittance);
    ended_ = is_black(beta_);
    return std::nullopt;
  }
  if (!std::isfinite(t_max) && medium.is_homogeneous()) return add_infinite_radiance();
  if (!emits && plan_.transmittance.grey && medium.is_achromatic()) return track_achromatic(medium, t_max);
  TentativeCollisions collisions(medium, ray_, t_max, flight_, plan_.transmittance.bricks, emits ? emission_rate(medium, t_max) : 0);
  if (emits && plan_.emission_collisions) collisions.gather_emission(medium, ray_, t_max);
  // Where nothing scatters β only shrinks: once little is left of it roulette decides, as for shadow rays.
  const float little = kTransmittanceRoulette * max_component(glm::abs(beta_));
  while (collisions.next()) {
    ++count_.medium_lookups;
    if (is_cancelled()) return std::nullopt;
    const float majorant = collisions.majorant(), inverse = 1 / majorant;
    const DVec3 p = ray_.at(collisions.t());
    const MediumPoint m = medium.at(p);
    if (emits) {
      ++count_.emission_lookups;
      add_volume_emission(medium, m.emission * inverse, p);
    }
    Rgb sigma_n = Rgb(majorant) - m.sigma_t;
    for (int c = 0; c < 3; ++c) sigma_n[c] = checked_null(sigma_n[c], majorant);
    const Rgb sigma_s = scatters ? m.sigma_s : Rgb(0);
    const Rgb size = glm::abs(beta_);
    const float sum = glm::dot(size, sigma_s + sigma_n);
    if (!(sum > 0)) {
      // Every channel that still carries light is absorbed here.
      ended_ = true;
      return std::nullopt;
    }
    // In double, since in thin matter under a high bound a share below 2⁻²⁴ meets more than 2²⁴ decisions.
    const float q = glm::dot(size, sigma_s) / sum;
    const bool real = scatters && flight_.uniform_double() < static_cast<double>(q);
    beta_ *= (real ? sigma_s : sigma_n) * (inverse / (real ? q : 1 - q));
    if (real) return collisions.t();
    if (!scatters && max_component(glm::abs(beta_)) < little) {
      ended_ = flight_.uniform() >= kRouletteSurvival;
      if (ended_) return std::nullopt;
      beta_ /= kRouletteSurvival;
    }
  }
  return std::nullopt;
}

template <uint32_t kMask>
std::optional<double> PathKernel<kMask>::track_achromatic(const Medium& medium, double t_max) {
  const float unit_t = medium.unit().sigma_t.x, unit_s = medium.unit().sigma_s.x;
  TentativeCollisions collisions(medium, ray_, t_max, flight_, plan_.transmittance.bricks);
  while (collisions.next()) {
    const float majorant = collisions.majorant();
    if (plan_.transmittance.residual && unit_s <= unit_t && collisions.in_constant_brick()) {
      beta_ *= unit_s / unit_t;
      return collisions.t();
    }
    ++count_.medium_lookups;
    if (is_cancelled()) return std::nullopt;
    const float density = medium.density(ray_.at(collisions.t()));
    const float sigma_s = unit_s * density, sigma_n = checked_null(majorant - unit_t * density, majorant), sum = sigma_s + sigma_n;
    if (!(sum > 0)) {
      ended_ = true;
      return std::nullopt;
    }
    beta_ *= sum / majorant;
    if (flight_.uniform_double() * static_cast<double>(sum) < static_cast<double>(sigma_s)) return collisions.t();
  }
  return std::nullopt;
}

template <uint32_t kMask>
void PathKernel<kMask>::add_volume_emission(const Medium& medium, Rgb radiance, DVec3 p) {
  if (is_black(radiance)) return;
  float mis = 1;
  if (uses(kEmissionSampling) && direction_pdf_ > 0 && medium.emission_importance() != nullptr) {
    const float sampled =
        world_.emissive_pmf(medium_) * medium.emission_importance()->pdf(p) * static_cast<float>(length_squared(p - reference_));
    mis = power_heuristic(direction_pdf_ * typical_rate(medium), sampled);
  }
  add(radiance * mis, [&] {
    return LightAdded{.technique = Technique::kCollision,
                      .source = medium_,
                      .from = reference_,
                      .wi = ray_.d,
                      .p = p,
                      .source_radiance = radiance,
                      .weight = mis};
  });
}

template <uint32_t kMask>
bool PathKernel<kMask>::scatter_in_medium(double t, DVec3 p) {
  const Medium& medium = world_.media[medium_];
  travelled_ += t;
  if (uses(kEquiangular)) last_flight_ = flight_to(t);
  if (aov_weight_ > 0) record_first_hit(albedo(medium.is_separable() ? medium.unit() : sample_.look_up(medium, p)), Vec3(0));
  next_vertex();
  const PhaseMix phase = medium.phase_at(p);
  const Vec3 wo(-ray_.d);
  note([&] { return MediumScatters{p, wo, t, medium_}; });

  const float share = std::exchange(next_light_share_, 1.0f);
  light_direction_.reset();
  sample_lights(p, [&](Vec3 wi, Scattered& scattered) {
    scattered = {phase.eval(wo, wi) * share, phase.pdf(wo, wi), {p, wi, ray_.time}, medium_, true};
  });
  const float branch = branch_probability(phase);
  const Vec3 to_light = branch > 0 ? *light_direction_ : Vec3(0);
  if (branch > 0) {
    note([&] { return BranchPossible{to_light, branch}; });
    branch_towards_light(phase, wo, p, to_light, branch);
    if (ended_) return false;
  }

  return split([&](PathKernel& part, bool) { return part.leave_in_medium(phase, p, wo, to_light, branch); });
}

template <uint32_t kMask>
bool PathKernel<kMask>::leave_in_medium(const PhaseMix& phase, DVec3 p, Vec3 wo, Vec3 to_light, float branch_probability) {
  Stream direction = stream(key_, vertex_, Purpose::kDirection);
  const Vec2 u = direction.uniform2();
  const auto sample = phase.sample(wo, u, direction.uniform());
  ray_ = {p, sample.wi, ray_.time};
  beta_ *= sample.weight;
  direction_pdf_ = sample.pdf;
  if (branch_probability > 0) next_light_share_ = sample.pdf / (sample.pdf + branch_probability * branch_pdf(phase, to_light, sample.wi));
  if (uses(kRefractedLight)) refraction_.reset();
  note([&] { return DirectionTaken{sample.wi, sample.pdf, beta_}; });
  after_scattering(p);
  return survives_roulette();
}

}  // namespace woodcock
