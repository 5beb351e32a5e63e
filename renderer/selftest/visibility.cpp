#include "renderer/selftest/visibility.h"

#include <cmath>

#include "renderer/scene/read_scene.h"
#include "renderer/selftest/random_draws.h"
#include "renderer/transport/transmittance.h"
#include "renderer/world/world.h"

namespace woodcock::selftest {
namespace {

constexpr int kMaxInterfaces = 200;

/// A hit, the ray that met it, and how far it is from where the search began.
struct Found {
  Hit hit;
  Ray ray;
  double distance;
};

/// The first hit that is no mere boundary.
std::optional<Found> first_hit(const World& world, DVec3 from, DVec3 direction) {
  double travelled = 0;
  Ray ray{from, direction};
  for (int i = 0; i < kMaxInterfaces; ++i) {
    const auto hit = world.geometry.intersect(ray, static_cast<double>(kInf));
    if (!hit) return std::nullopt;
    travelled += hit->t;
    if (!world.surfaces[static_cast<size_t>(hit->shape)].is_interface) return Found{*hit, ray, travelled};
    const SurfacePoint s = world.geometry.surface(*hit, ray, Geometry::Tangents::kNotWanted);
    ray.o = offset_origin(s, ray.d);
    travelled = glm::length(ray.o - from);
  }
  return std::nullopt;
}

enum class Seen { kYes, kNo, kUnclear };

/// By the first hit: yes where it is the sampled point, no where it is clearly another one.
Seen by_first_hit(const World& world, DVec3 from, const LightSample& light) {
  const double distance = glm::length(light.p - from);
  const DVec3 direction = (light.p - from) / distance;
  const auto found = first_hit(world, from, direction);
  const Box3 box = bounds_of(world.geometry.shapes()[static_cast<size_t>(light.target.shape)]);
  const double size = static_cast<double>(glm::length(box.extent()));
  if (!found) return Seen::kUnclear;
  const double apart = std::abs(found->distance - distance);
  if (apart < 1e-6 * size && found->hit.shape == light.target.shape) return Seen::kYes;
  // A ray that went on behind boundaries is a little off, which counts where it meets the light at a small angle.
  const bool is_close = apart < 0.02 * size || world.geometry.is_target(found->hit, found->ray, light.target);
  return is_close ? Seen::kUnclear : Seen::kNo;
}

}  // namespace

VisibilityCount compare_visibility(const std::string& text, double unit, DVec3 center, uint64_t seed, int points) {
  const SceneDescription description = read_scene_text(text, "selftest.pbrt", ".", {});
  const auto world = build_world(description);
  RandomDraws draw(hash_combine(seed, 0x766973ULL));
  PathCounters counters;
  VisibilityCount count;
  Stream random(seed);
  for (int i = 0; i < points; ++i) {
    const DVec3 at = center + 2 * unit * draw.in_ball();
    const DVec3 from = world->space.scale * (at - world->space.center);
    const double u_choice = draw.unit(), u_x = draw.unit(), u_y = draw.unit(), u_primitive = draw.unit();
    const auto choice = world->lights.choose_bounded(u_choice);
    if (!choice) return count;
    const auto light =
        world->lights.sample(choice->light, from, Vec2(static_cast<float>(u_x), static_cast<float>(u_y)) * kOneMinusEpsilon, u_primitive);
    if (!light || !light->is_bounded || light->target.shape == kNone) continue;
    const Seen expected = by_first_hit(*world, from, *light);
    if (expected == Seen::kUnclear) continue;
    const DVec3 to = light->p - from;
    const double distance = glm::length(to);
    const Shadow shadow =
        trace_shadow(*world, {from, to / distance}, distance, kNone, light->target, random, {}, world->has_transparent_surfaces, counters);
    ++count.compared;
    count.visible += expected == Seen::kYes ? 1 : 0;
    count.different += is_black(shadow.transmittance) == (expected == Seen::kYes) ? 1 : 0;
  }
  return count;
}

}  // namespace woodcock::selftest
