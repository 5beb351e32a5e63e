#include "renderer/world/emission_share.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "renderer/core/random.h"
#include "renderer/core/warp.h"

namespace woodcock {
namespace {

constexpr int kRays = 32;  // each way across the picture
constexpr int kMaxCrossings = 8;
constexpr int kSteps = 8;  // of the way out of the medium

/// A place that light may arrive at; all directions count alike where there is no normal.
struct Place {
  DVec3 p;
  std::optional<Vec3> normal;

  double cosine(Vec3 wi) const { return normal ? std::max(0.0, static_cast<double>(glm::dot(*normal, wi))) : 1; }
};

template <typename Use>
void for_each_place(const World& world, Ray ray, Use&& use) {
  int medium = world.camera_medium;
  for (int crossing = 0; crossing < kMaxCrossings; ++crossing) {
    const auto hit = world.geometry.intersect(ray, kInf);
    if (!hit) return;
    if (medium != kNone && world.media[medium].scatters()) use(Place{ray.at(hit->t / 2), std::nullopt});
    const SurfacePoint s = world.geometry.surface(*hit, ray, Geometry::Tangents::kNotWanted);
    const SurfaceInfo& info = world.surfaces[static_cast<size_t>(hit->shape)];
    if (!info.is_interface) return use(Place{s.p, glm::dot(s.ng, Vec3(ray.d)) < 0 ? s.ng : -s.ng});
    medium = world.medium_after(info, s.ng, ray.d, medium);
    ray = ray_from(s, ray.d, ray.time);
  }
}

/// Light of the skies in a uniform direction; sampling lights leaves a part of it to scattering.
double sample_skies(const World& world, const Place& place, Stream& random) {
  if (!world.lights.has_environment()) return 0;
  const Vec3 wi = square_to_sphere(random.uniform2());
  const double other = static_cast<double>(world.lights.environment_pdf(wi, place.p)), pdf = static_cast<double>(square_to_sphere_pdf());
  // The balance heuristic over this and the sampling of lights.
  return static_cast<double>(average(world.lights.environment(wi))) * place.cosine(wi) / (pdf + other);
}

/// What one sample would bring: light times cosine over density, with nothing in the way but the emitting medium itself.
double sample_lights(const World& world, const Place& place, Stream& random) {
  const auto choice = world.lights.choose(random.uniform_double(), place.p);
  if (!choice) return 0;
  const Vec2 u = random.uniform2();
  const auto light = world.lights.sample(choice->light, place.p, u, random.uniform_double());
  if (!light) return 0;
  double density = static_cast<double>(choice->pmf) * static_cast<double>(light->pdf);
  if (!light->is_bounded && !light->delta) density += static_cast<double>(square_to_sphere_pdf());
  return static_cast<double>(average(light->radiance)) * place.cosine(light->wi) / density;
}

double sample_emission(const World& world, const Place& place, Stream& random) {
  const int chosen = world.choose_emissive(random.uniform_double());
  const Medium& medium = world.media[chosen];
  const Vec2 u = random.uniform2();
  const float u_z = random.uniform();
  const auto brick = medium.emission_importance()->sample({u.x, u.y, u_z}, random.uniform_double());
  const DVec3 to = brick.p - place.p;
  const double distance = glm::length(to);
  if (!(distance > 0)) return 0;
  double depth = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double part = (i + 0.5) / kSteps;
    depth += static_cast<double>(average(medium.sigma_t(place.p + part * to))) * distance / kSteps;
  }
  const double density = static_cast<double>(world.emissive_pmf(chosen)) * static_cast<double>(brick.pdf) * distance * distance;
  return static_cast<double>(average(medium.at(brick.p).emission)) * std::exp(-depth) * place.cosine(Vec3(to / distance)) / density;
}

}  // namespace

double emission_share(const World& world, const FilmDescription& film) {
  if (world.emissive_media.empty()) return 0;
  double lights = 0, emission = 0;
  Stream random(0x676c6f77ULL);
  for (int y = 0; y < kRays; ++y)
    for (int x = 0; x < kRays; ++x) {
      const DVec2 raster((x + 0.5) / kRays * film.x_resolution, (y + 0.5) / kRays * film.y_resolution);
      for_each_place(world, world.camera.ray(raster, Vec2(0.5f), 0), [&](const Place& place) {
        lights += sample_lights(world, place, random) + sample_skies(world, place, random);
        emission += sample_emission(world, place, random);
      });
    }
  const double share = emission / (emission + lights);
  // Where the camera sees nothing that light could arrive at, nothing speaks for shadow rays to emission.
  return std::isfinite(share) ? share : 0;
}

}  // namespace woodcock
