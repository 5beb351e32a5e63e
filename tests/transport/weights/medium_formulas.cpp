// Media and the ways through them, from their formulas.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include "tests/transport/weights/scattering_formulas.h"
#include "tests/transport/weights/scene_formulas.h"

namespace woodcock::testing {
namespace {

double mean(DVec3 c) { return (c.x + c.y + c.z) / 3; }
DVec3 point(const DMat4& m, DVec3 p) { return DVec3(m * glm::dvec4(p, 1)); }

/// From render space to cells, the first voxel's from 0 to 1.
template <typename Grid>
DMat4 cells(const Grid& grid, const DMat4& medium_from_render) {
  DMat4 m(1);
  for (int i = 0; i < 3; ++i) {
    m[i][i] = grid.size[i] / (grid.p1[i] - grid.p0[i]);
    m[3][i] = -grid.p0[i] * m[i][i];
  }
  return m * medium_from_render;
}

template <typename Visit>
void for_each(IVec3 size, Visit&& visit) {
  for (int z = 0; z < size.z; ++z)
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x) visit(IVec3(x, y, z));
}

size_t place(IVec3 v, IVec3 size) {
  return (static_cast<size_t>(v.z) * static_cast<size_t>(size.y) + static_cast<size_t>(v.y)) * static_cast<size_t>(size.x) +
         static_cast<size_t>(v.x);
}

}  // namespace

MediumFormula::MediumFormula(const MediumDescription& medium, const RenderSpace& space) {
  const DMat4 medium_from_render = glm::inverse(space.render_from_world * medium.world_from_medium);
  const double per_unit = 1 / space.scale;
  if (const auto* h = std::get_if<HomogeneousDescription>(&medium.kind)) {
    sigma_a_ = DVec3(h->sigma_a) * per_unit;
    sigma_s_ = DVec3(h->sigma_s) * per_unit;
    le_ = DVec3(h->emission);
    phase_ = h->phase;
    scatters_ = mean(sigma_s_) > 0;
    emits_ = mean(sigma_a_ * le_) > 0;
    mean_ = mean(sigma_a_ + sigma_s_);
    return;
  }
  Grid grid;
  if (const auto* g = std::get_if<GridMediumDescription>(&medium.kind)) {
    const auto& density = std::get<DenseGrid<float>>(*g->density);
    if (g->emission_grid || g->temperature) throw std::logic_error("no formula for grids of emission or temperature");
    grid.size = density.size;
    grid.cell_from_render = cells(density, medium_from_render);
    for (const float value : density.values) {
      grid.sigma_a.push_back(DVec3(g->sigma_a) * (per_unit * static_cast<double>(value)));
      grid.sigma_s.push_back(DVec3(g->sigma_s) * (per_unit * static_cast<double>(value)));
    }
    le_ = DVec3(g->emission) * static_cast<double>(g->emission_scale);
    phase_ = g->phase;
  } else {
    const auto& g3 = std::get<RgbGridMediumDescription>(medium.kind);
    grid.size = g3.sigma_a->size;
    grid.cell_from_render = cells(*g3.sigma_a, medium_from_render);
    const double scale = per_unit * static_cast<double>(g3.scale);
    for (const Rgb value : g3.sigma_a->values) grid.sigma_a.push_back(DVec3(value) * scale);
    for (const Rgb value : g3.sigma_s->values) grid.sigma_s.push_back(DVec3(value) * scale);
    if (g3.emission)
      for (const Rgb value : g3.emission->values) grid.emission.push_back(DVec3(value) * static_cast<double>(g3.emission_scale));
    phase_ = g3.phase;
  }
  grid.cell_volume = 1 / std::abs(glm::determinant(glm::dmat3(grid.cell_from_render)));
  grid_ = std::move(grid);
  average();
  if (emits_) add_voxels();
}

/// An interpolant is linear along each axis of half a cell: its mean there is its value in the middle.
void MediumFormula::average() {
  double sum = 0, scattering = 0;
  const IVec3 halves = 2 * grid_->size;
  for_each(halves, [&](IVec3 v) {
    const DVec3 c = (DVec3(v) + 0.5) / 2.0;
    const DVec3 a = interpolate(grid_->sigma_a, c), s = interpolate(grid_->sigma_s, c);
    sum += mean(a + s);
    scattering += mean(s);
    const DVec3 le = grid_->emission.empty() ? le_ : interpolate(grid_->emission, c);
    emits_ = emits_ || mean(a * le) > 0;
  });
  mean_ = sum / (halves.x * halves.y * halves.z);
  scatters_ = scattering > 0;
}

DVec3 MediumFormula::voxel(const std::vector<DVec3>& voxels, IVec3 v) const {
  for (int i = 0; i < 3; ++i)
    if (v[i] < 0 || v[i] >= grid_->size[i]) return DVec3(0);
  return voxels[place(v, grid_->size)];
}

DVec3 MediumFormula::interpolate(const std::vector<DVec3>& voxels, DVec3 c) const {
  for (int i = 0; i < 3; ++i)
    if (!(c[i] >= 0 && c[i] <= grid_->size[i])) return DVec3(0);
  const DVec3 first = glm::floor(c - 0.5), f = c - 0.5 - first;
  DVec3 sum(0);
  for_each(IVec3(2), [&](IVec3 k) {
    const DVec3 w = glm::mix(1.0 - f, f, DVec3(k));
    sum += w.x * w.y * w.z * voxel(voxels, IVec3(first) + k);
  });
  return sum;
}

MediumFormula::MediumFormula(std::vector<MediumFormula> parts) : parts_(std::move(parts)) {
  for (const MediumFormula& part : parts_) {
    scatters_ = scatters_ || part.scatters_;
    emits_ = emits_ || part.emits_;
    mean_ += part.mean_;
  }
}

bool MediumFormula::is_homogeneous() const {
  return !grid_ && std::all_of(parts_.begin(), parts_.end(), [](const MediumFormula& m) { return m.is_homogeneous(); });
}

bool MediumFormula::samples_emission() const {
  return (grid_ && emits_) || std::any_of(parts_.begin(), parts_.end(), [](const MediumFormula& m) { return m.samples_emission(); });
}

DVec3 MediumFormula::sigma_a(DVec3 p) const {
  DVec3 sum = grid_ ? interpolate(grid_->sigma_a, cell(p)) : sigma_a_;
  for (const MediumFormula& part : parts_) sum += part.sigma_a(p);
  return sum;
}

DVec3 MediumFormula::sigma_s(DVec3 p) const {
  DVec3 sum = grid_ ? interpolate(grid_->sigma_s, cell(p)) : sigma_s_;
  for (const MediumFormula& part : parts_) sum += part.sigma_s(p);
  return sum;
}

DVec3 MediumFormula::emission(DVec3 p) const {
  if (parts_.empty()) return sigma_a(p) * (grid_ && !grid_->emission.empty() ? interpolate(grid_->emission, cell(p)) : le_);
  DVec3 sum(0);
  for (const MediumFormula& part : parts_) sum += part.emission(p);
  return sum;
}

/// Parts mix by their σs in each channel, and are sampled by the mean of the channels.
MediumFormula::Phase MediumFormula::phase(DVec3 p, DVec3 wo, DVec3 wi) const {
  if (parts_.empty()) {
    const double density = phase_density(phase_, wo, wi);
    return {DVec3(density), density};
  }
  const DVec3 all = sigma_s(p);
  Phase sum{DVec3(0), 0};
  for (const MediumFormula& part : parts_) {
    const double density = phase_density(part.phase_, wo, wi);
    const DVec3 s = part.sigma_s(p);
    for (int c = 0; c < 3; ++c) sum.value[c] += all[c] > 0 ? s[c] / all[c] * density : 0;
    sum.pdf += mean(s) / mean(all) * density;
  }
  return sum;
}

double MediumFormula::diagonal() const {
  double smallest = grid_ ? glm::length(DVec3(grid_->size)) * std::cbrt(grid_->cell_volume) : 1e300;
  for (const MediumFormula& part : parts_) smallest = std::min(smallest, part.diagonal());
  return smallest;
}

double MediumFormula::typical_rate() const { return std::max(4 / diagonal(), mean_); }

double MediumFormula::emitted_power() const {
  double sum = power_;
  for (const MediumFormula& part : parts_) sum += part.emitted_power();
  return sum;
}

/// Voxel by voxel, in proportion to the emission at eight points of each, and a 64th of it by volume.
void MediumFormula::add_voxels() {
  std::vector<double> power;
  double all_power = 0;
  for_each(grid_->size, [&](IVec3 v) {
    double sum = 0;
    for_each(IVec3(2), [&](IVec3 half) {
      const DVec3 c = DVec3(v) + 0.25 + 0.5 * DVec3(half);
      const DVec3 le = grid_->emission.empty() ? le_ : interpolate(grid_->emission, c);
      sum += mean(interpolate(grid_->sigma_a, c) * le);
    });
    power.push_back(sum / 8 * grid_->cell_volume);
    all_power += power.back();
  });
  for (size_t i = 0; i < power.size(); ++i)
    voxel_pdf_.push_back((power[i] / all_power + 1.0 / static_cast<double>(power.size()) / 64) / (1 + 1.0 / 64) / grid_->cell_volume);
  power_ = 4 * std::numbers::pi * all_power;
}

double MediumFormula::emission_pdf(DVec3 p) const {
  if (!parts_.empty()) {
    // Parts are chosen by power, and a 64th of the time alike.
    double sum = 0, sampled = 0;
    for (const MediumFormula& part : parts_) sampled += part.samples_emission() ? 1 : 0;
    for (const MediumFormula& part : parts_)
      if (part.samples_emission()) sum += (part.power_ / emitted_power() + 1 / (64 * sampled)) / (1 + 1.0 / 64) * part.emission_pdf(p);
    return sum;
  }
  const DVec3 c = cell(p);
  for (int i = 0; i < 3; ++i) {
    const double outside = std::max(-c[i], c[i] - grid_->size[i]);
    if (std::abs(outside) < 1e-4) throw TooNear{};
    if (outside > 0) return 0;
  }
  IVec3 v;
  for (int i = 0; i < 3; ++i) {
    // At a face rounding decides.
    if (std::abs(c[i] - std::round(c[i])) < 1e-5 && c[i] > 0.5 && c[i] < grid_->size[i] - 0.5) throw TooNear{};
    v[i] = std::clamp(static_cast<int>(std::floor(c[i])), 0, grid_->size[i] - 1);
  }
  return voxel_pdf_[place(v, grid_->size)];
}

std::pair<double, double> Body::chord(DVec3 o, DVec3 d) const {
  if (sphere) {
    const DVec3 to = center - o;
    const double middle = glm::dot(to, d), h2 = glm::dot(to - middle * d, to - middle * d), half2 = radius * radius - h2;
    if (half2 <= 0) return {1, 0};
    return {middle - std::sqrt(half2), middle + std::sqrt(half2)};
  }
  double first = -1e300, second = 1e300;
  for (int i = 0; i < 3; ++i) {
    const double a = (lower[i] - o[i]) / d[i], b = (upper[i] - o[i]) / d[i];
    first = std::max(first, std::min(a, b));
    second = std::min(second, std::max(a, b));
  }
  return {first, second};
}

double Body::depth(DVec3 p) const {
  if (sphere) return radius - glm::distance(p, center);
  const DVec3 room = glm::min(p - lower, upper - p);
  return std::min({room.x, room.y, room.z});
}

SceneFormulas::SceneFormulas(const SceneDescription& scene, const World& world) : scene_(scene) {
  // How large the scene is counts in the choice of lights only.
  const Box3 bounds = world.geometry.bounds();
  const double radius = bounds.empty() ? 1 : 0.5 * glm::length(DVec3(bounds.upper) - DVec3(bounds.lower));
  for (const LightDescription& light : scene.lights) lights_.emplace_back(light, world.space, radius);
  for (const ShapeDescription& shape : scene.shapes)
    if (shape.area_light) lights_.emplace_back(shape, world.space);
  double total = 0, shining = 0, bounded = 0, emitted = 0;
  for (const LightFormula& light : lights_) {
    // A constant sky is left to scattering.
    total += light.is_infinite() ? 0 : mean(light.power());
    shining += !light.is_infinite() && mean(light.power()) > 0 ? 1 : 0;
  }
  for (const LightFormula& light : lights_) {
    const double power = light.is_infinite() ? 0 : mean(light.power());
    pmf_.push_back(power > 0 ? 0.8 * power / total + 0.2 / shining : 0);
    bounded_pmf_.push_back(light.is_bounded() ? pmf_.back() : 0);
    bounded += bounded_pmf_.back();
  }
  for (double& p : bounded_pmf_) p = bounded > 0 ? p / bounded : 0;

  around_ = scene.camera.media.given ? scene.camera.media.outside : kNone;
  for (const MediumDescription& medium : scene.media) {
    if (const auto* sum = std::get_if<SumMediumDescription>(&medium.kind)) {
      std::vector<MediumFormula> parts;
      for (const int part : sum->media) parts.emplace_back(scene.media[static_cast<size_t>(part)], world.space);
      media_.emplace_back(std::move(parts));
    } else {
      media_.emplace_back(medium, world.space);
    }
  }
  for (const ShapeDescription& shape : scene.shapes) {
    if (!shape.media.given || shape.media.inside == shape.media.outside) continue;
    const DMat4 to_render = world.space.render_from_world * shape.world_from_object;
    Body body;
    body.inside = shape.media.inside;
    if (const auto* sphere = std::get_if<SphereDescription>(&shape.kind)) {
      body.center = point(to_render, DVec3(0));
      body.radius = sphere->radius * std::cbrt(std::abs(glm::determinant(glm::dmat3(to_render))));
    } else {
      body.sphere = false;
      body.lower = DVec3(1e300);
      body.upper = DVec3(-1e300);
      for (const DVec3 p : std::get<std::shared_ptr<const TriangleMesh>>(shape.kind)->positions) {
        body.lower = glm::min(body.lower, point(to_render, p));
        body.upper = glm::max(body.upper, point(to_render, p));
      }
    }
    if (const auto* glass = std::get_if<DielectricDescription>(&scene.materials[static_cast<size_t>(shape.material)].kind);
        glass != nullptr && glass->roughness.u.value == 0 && glass->roughness.v.value == 0)
      body.eta = static_cast<double>(glass->eta);
    // Which of them are worth while, and whether anything stands inside, is the world's to say.
    for (const DielectricSphere& found : world.dielectric_spheres)
      if (body.sphere && glm::distance(found.sphere.center, body.center) < 0.5 * body.radius) {
        body.samples_refraction = true;
        body.is_empty = found.is_empty;
      }
    for (const DielectricMeshes::Body& found : world.dielectric_meshes.bodies())
      if (!body.sphere && glm::distance(found.lower, body.lower) + glm::distance(found.upper, body.upper) < 1e-3 * found.size())
        body.samples_refraction = true;
    bodies_.push_back(body);
  }
  emissive_pmf_.resize(media_.size());
  for (const Body& body : bodies_)
    if (body.inside != kNone && medium(body.inside).samples_emission())
      emissive_pmf_[static_cast<size_t>(body.inside)] = medium(body.inside).emitted_power();
  for (const double p : emissive_pmf_) emitted += p;
  for (double& p : emissive_pmf_) p = emitted > 0 ? p / emitted : 0;
}

double SceneFormulas::pmf(int light, DVec3 at, bool by_power) const {
  if (by_power) return pmf_[static_cast<size_t>(light)];
  double bounded = 0, infinite = 0;
  int shining = 0, distant = 0, sampled = 0;
  for (const LightFormula& l : lights_) {
    if (l.is_infinite() || !(mean(l.power()) > 0)) continue;
    ++sampled;
    const double expected = l.expected(at);
    (l.is_bounded() ? bounded : infinite) += expected;
    (l.is_bounded() ? shining : distant) += expected > 0 ? 1 : 0;
  }
  const LightFormula& chosen = lights_[static_cast<size_t>(light)];
  if (chosen.is_infinite() || !(mean(chosen.power()) > 0)) return 0;
  if (sampled > 16) throw std::logic_error("no formula for a tree of lights");
  if (sampled == 1) return 1;
  // A tenth of the choices is even: between the two kinds, and within each.
  double of_infinite = distant == 0 ? 0 : 1;
  if (distant > 0 && shining > 0) of_infinite = 0.9 * infinite / (infinite + bounded) + 0.05;
  const double expected = chosen.expected(at);
  if (!(expected > 0)) return 0;
  if (chosen.is_bounded()) return (1 - of_infinite) * (0.9 * expected / bounded + 0.1 / shining);
  return of_infinite * (0.9 * expected / infinite + 0.1 / distant);
}

const Body* SceneFormulas::glass_around(DVec3 p) const {
  for (const Body& body : bodies_) {
    if (!body.samples_refraction || body.eta == 1) continue;
    const double inside = body.depth(p);
    if (std::abs(inside) < 1e-6) throw TooNear{};
    if (inside > 0) return &body;
  }
  return nullptr;
}

DVec3 SceneFormulas::environment() const {
  DVec3 sum(0);
  for (int i = 0; i < lights(); ++i)
    if (light(i).is_infinite()) sum += light(i).radiance(DVec3(0), 0, DVec3(0), DVec3(0), true);
  return sum;
}

std::optional<int> SceneFormulas::medium_at(DVec3 p, double margin) const {
  for (const Body& body : bodies_) {
    const double inside = body.depth(p);
    if (std::abs(inside) < margin) return std::nullopt;
    if (inside > 0) return body.inside;
  }
  return around_;
}

std::optional<SceneFormulas::Way> SceneFormulas::way(DVec3 o, DVec3 d, double length) const {
  DVec3 depth(0);
  double outside = length;
  for (const Body& body : bodies_) {
    const auto [first, second] = body.chord(o, d);
    const double inside = std::min(second, length) - std::max(first, 0.0);
    if (!(inside > 0)) continue;
    outside -= inside;
    if (body.inside == kNone) continue;
    if (!medium(body.inside).is_homogeneous()) return std::nullopt;
    depth += medium(body.inside).sigma_t(o) * inside;
  }
  if (around_ != kNone) {
    if (!medium(around_).is_homogeneous()) return std::nullopt;
    for (int c = 0; c < 3; ++c)
      if (medium(around_).sigma_t(o)[c] > 0) depth[c] += medium(around_).sigma_t(o)[c] * std::max(outside, 0.0);
  }
  return Way{glm::exp(-depth), std::max({depth.x, depth.y, depth.z})};
}

}  // namespace woodcock::testing
