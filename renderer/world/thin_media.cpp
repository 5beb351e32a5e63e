#include "renderer/world/thin_media.h"

#include <fmt/format.h>

#include <algorithm>

#include "renderer/world/coincident_hits.h"

namespace woodcock {
namespace {

constexpr int kRays = 32;  // each way across the picture
constexpr int kMaxCrossings = 64;
/// Optical depth below which a loss cannot be seen.
constexpr double kMinDepth = 1e-3;
/// What rays start off a surface, at the most usual, in parts of the size of render space.
constexpr double kOffset = 2e-14;

}  // namespace

std::vector<std::string> thin_media(const World& world, const FilmDescription& film, const std::vector<std::string>& medium_names) {
  std::vector<std::string> notes;
  for (size_t i = 0; i < medium_names.size(); ++i) {
    const double depth = kOffset * static_cast<double>(world.media[static_cast<int>(i)].maximum_sigma_t());
    if (!(depth > kMinDepth)) continue;
    notes.push_back(
        fmt::format("the medium \"{}\" is so dense that rays start {:.2g} mean free paths off its surface: what leaves it after a "
                    "few scatterings comes out too dark; move the camera closer, or give the scene without what is far away",
                    medium_names[i], depth));
  }
  std::vector<double> lost(medium_names.size(), 0);
  const bool may_lose =
      std::any_of(world.surfaces.begin(), world.surfaces.end(), [](const SurfaceInfo& s) { return s.is_boundary && s.may_overlap(); });
  if (!may_lose) return notes;
  for (int y = 0; y < kRays; ++y)
    for (int x = 0; x < kRays; ++x) {
      const DVec2 raster((x + 0.5) / kRays * film.x_resolution, (y + 0.5) / kRays * film.y_resolution);
      Ray ray = world.camera.ray(raster, Vec2(0.5f), 0);
      for (int crossing = 0; crossing < kMaxCrossings; ++crossing) {
        const auto hit = world.geometry.intersect(ray, kInf);
        if (!hit) break;
        const SurfacePoint s = world.geometry.surface(*hit, ray, Geometry::Tangents::kNotWanted);
        if (!may_coincide(world, ray, *hit, s.p)) {
          ray = ray_from(s, ray.d, ray.time);
          continue;
        }
        const CoincidentHits coincident(world, ray, *hit);
        coincident.for_each_gap([&](int medium, double length) {
          double& most = lost[static_cast<size_t>(medium)];
          most = std::max(most, length * static_cast<double>(world.media[medium].maximum_sigma_t()));
        });
        ray = coincident.ray_from(s.p, ray.d, ray.time);
      }
    }
  for (size_t i = 0; i < lost.size(); ++i) {
    if (!(lost[i] > kMinDepth)) continue;
    notes.push_back(
        fmt::format("the medium \"{}\" fills a gap that is thinner than 4e-7 of the scene's size, where surfaces count as "
                    "coincident: up to {:.2g} mean free paths of it are left out; move the camera closer or make the gap wider",
                    medium_names[i], lost[i]));
  }
  return notes;
}

}  // namespace woodcock
