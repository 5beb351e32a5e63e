#include "renderer/world/dielectric_spheres.h"

#include <algorithm>
#include <cmath>

#include "renderer/core/transform.h"
#include "renderer/world/glass_shapes.h"
#include "renderer/world/world.h"

namespace woodcock {
namespace {

/// The length that `m` gives to every unit vector; nothing where it depends on the direction.
std::optional<double> uniform_scale(const DMat4& m) {
  const DVec3 x(m[0]), y(m[1]), z(m[2]);
  const double scale = glm::length(x), allowed = 1e-9 * scale * scale;
  const bool uniform = std::abs(glm::dot(y, y) - scale * scale) < allowed && std::abs(glm::dot(z, z) - scale * scale) < allowed &&
                       std::abs(glm::dot(x, y)) < allowed && std::abs(glm::dot(y, z)) < allowed && std::abs(glm::dot(z, x)) < allowed;
  if (!uniform || !(scale > 0)) return std::nullopt;
  return scale;
}

/// Whether the box lies apart from the ball.
bool is_apart(const Box3& box, const Sphere& s) {
  const DVec3 nearest = glm::clamp(s.center, DVec3(box.lower), DVec3(box.upper));
  return glm::distance(nearest, s.center) > s.radius * (1 - 1e-6);
}

class Finder {
 public:
  explicit Finder(const GlassScene& glass) : glass_(glass), placed_(glass.geometry.placed_shapes()) {}

  void add(const ShapeDescription& description, int shape, const DMat4& render_from_space) {
    const SurfaceInfo& info = glass_.surfaces[static_cast<size_t>(shape)];
    const Shape& geometric = glass_.geometry.shapes()[static_cast<size_t>(shape)];
    const auto* quadric = std::get_if<Quadric>(&geometric.geometry);
    if (quadric == nullptr || !std::holds_alternative<SphereDescription>(description.kind)) return;
    if (quadric->z_min > -quadric->radius || quadric->z_max < quadric->radius) return;
    if (std::get<SphereDescription>(description.kind).phi_max < 360) return;
    const float eta = smooth_glass_index(glass_.scene, info);
    const DMat4 placed = render_from_space * quadric->render_from_object;
    const std::optional<double> scale = uniform_scale(placed);
    if (eta == 1 || !scale) return;
    DielectricSphere body{{DVec3(placed[3]), *scale * quadric->radius}, shape, geometric.flip ? 1 / eta : eta, geometric.flip, true};
    size_t apart = 0;
    for (const PlacedShape& other : placed_) apart += is_apart(other.bounds, body.sphere);
    // A light sample from a lamp inside takes no part in the roulette of those through the glass.
    const bool has_lamp = std::any_of(glass_.light_positions.begin(), glass_.light_positions.end(),
                                      [&](DVec3 p) { return glm::distance(p, body.sphere.center) < body.sphere.radius * (1 + 1e-6); });
    body.is_empty = apart + 1 == placed_.size() && !has_lamp;
    const int inside = info.is_boundary ? (geometric.flip ? info.outside : info.inside) : kNone;
    const bool scatters = inside != kNone && glass_.media[inside].scatters();
    if (scatters || !body.is_empty) found_.push_back(body);
  }

  std::vector<DielectricSphere> take() {
    std::stable_sort(found_.begin(), found_.end(),
                     [](const DielectricSphere& a, const DielectricSphere& b) { return a.sphere.radius < b.sphere.radius; });
    // The largest stay: they cover most of the picture.
    if (found_.size() > kMaxDielectricSpheres) found_.erase(found_.begin(), found_.end() - static_cast<ptrdiff_t>(kMaxDielectricSpheres));
    return std::move(found_);
  }

 private:
  const GlassScene& glass_;
  std::vector<PlacedShape> placed_;
  std::vector<DielectricSphere> found_;
};

}  // namespace

std::vector<DielectricSphere> find_dielectric_spheres(const GlassScene& glass) {
  Finder finder(glass);
  glass.for_each_shape([&](const ShapeDescription& description, int shape, int, const DMat4& render_from_space) {
    finder.add(description, shape, render_from_space);
  });
  return finder.take();
}

}  // namespace woodcock
