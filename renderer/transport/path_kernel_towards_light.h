// The path loop in media: branches towards a light.
#pragma once

#include <numbers>

#include "renderer/transport/path_kernel.h"

namespace woodcock {

template <uint32_t kMask>
float PathKernel<kMask>::branch_probability(const PhaseMix& phase) const {
  if (!plan_.towards_light || !light_direction_ || !may_scatter()) return 0;
  if (uses(kEquiangular)) return vertex_ < kEquiangularVertices ? kPassingBranchProbability : 0;
  return phase.pdf(-*light_direction_, *light_direction_) > kMinForwardPeak ? kBranchProbability : 0;
}

template <uint32_t kMask>
float PathKernel<kMask>::branch_pdf(const PhaseMix& phase, Vec3 to_light, Vec3 w) const {
  if (!uses(kEquiangular)) return phase.pdf(-to_light, w);
  const double sine = glm::length(glm::cross(DVec3(to_light), DVec3(w)));
  return static_cast<float>(1 / (2 * std::numbers::pi * std::numbers::pi * std::max(sine, 1e-12)));
}

template <uint32_t kMask>
Vec3 PathKernel<kMask>::branch_direction(const PhaseMix& phase, Vec3 to_light, Stream& random) const {
  const Vec2 u = random.uniform2();
  if (!uses(kEquiangular)) return phase.sample(-to_light, u, random.uniform()).wi;
  const float theta = std::numbers::pi_v<float> * u.x, phi = 2 * std::numbers::pi_v<float> * u.y;
  return glm::normalize(
      Frame::from_normal(to_light).to_world({std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)}));
}

template <uint32_t kMask>
void PathKernel<kMask>::branch_towards_light(const PhaseMix& phase, Vec3 wo, DVec3 p, Vec3 to_light, float probability) {
  const PathKey branch = branch_key(key_, kTowardsLightBranch);
  Stream direction = stream(branch, vertex_, Purpose::kDirection);
  if (direction.uniform_double() >= static_cast<double>(probability)) return;
  const Vec3 w = branch_direction(phase, to_light, direction);
  const Rgb weight = phase.eval(wo, w) / (phase.pdf(wo, w) + probability * branch_pdf(phase, to_light, w));
  if (is_black(weight)) return;

  // begin_segment() gives the path its own numbers again.
  const auto path = std::tuple(key_, beta_, ray_, last_flight_);
  key_ = branch;
  beta_ *= weight;
  ray_ = {p, w, ray_.time};
  begin_segment();
  note([&] { return BranchStarts{w, beta_}; });
  ++count_.rays;
  const auto hit = find_hit();
  const auto t = sample_distance(hit ? hit->t : no_hit_until_);
  if (!ended_) note([&] { return SegmentEnds{t, beta_}; });
  if (t && !ended_) {
    if (uses(kEquiangular)) last_flight_ = flight_to(*t);
    const DVec3 at = point_before(world_, ray_, *t, hit, uses(kTouching));
    const PhaseMix phase_there = world_.media[medium_].phase_at(at);
    const Vec3 wo_there(-ray_.d);
    note([&] { return MediumScatters{at, wo_there, *t, medium_}; });
    sample_light(at, [&](Vec3 wi, Scattered& scattered) {
      scattered = {phase_there.eval(wo_there, wi), phase_there.pdf(wo_there, wi), {at, wi, ray_.time}, medium_, true};
    });
  }
  note([] { return BranchEnds{}; });
  std::tie(key_, beta_, ray_, last_flight_) = path;
  ended_ = sample_.stopped;
}

}  // namespace woodcock
