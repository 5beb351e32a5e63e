#include "renderer/media/medium.h"

#include <fmt/format.h>

#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

/// The finest bricks that are considered, in cells.
constexpr int kFinestEdge = 4;

/// Checks the coefficients of a medium, where messages need to say whose they are.
class Checks {
 public:
  Checks(const MediumDescription& description, std::vector<std::string>& notes) : description_(description), notes_(notes) {}

  void coefficient(Rgb value, const char* name) const {
    if (!is_finite(value) || value.x < 0 || value.y < 0 || value.z < 0)
      fail(fmt::format("{} is ({}, {}, {}); it must be finite and not negative", name, value.x, value.y, value.z));
  }
  float mean_cosine(float g) const {
    if (!(std::abs(g) < 1)) fail(fmt::format("g is {}; the mean cosine must lie between -1 and 1, both excluded", g));
    return g;
  }
  /// A copy of a grid in which negative values, which interpolation and filtering of simulations leave behind, are 0.
  template <typename T>
  DenseGrid<T> without_negatives(const DenseGrid<T>& grid, const char* name) const {
    DenseGrid<T> result = grid;
    size_t negative = 0;
    for (T& value : result.values) {
      const Rgb v(value);
      if (!is_finite(v)) fail(fmt::format("the {} grid holds a value that is not finite", name));
      if (v.x < 0 || v.y < 0 || v.z < 0) {
        ++negative;
        value = glm::max(value, T(0));
      }
    }
    note_negative(negative, name);
    return result;
  }
  void note_negative(size_t count, const char* name) const {
    if (count != 0)
      notes_.push_back(fmt::format("medium \"{}\": {} negative values of its {} grid are read as 0", description_.name, count, name));
  }
  [[noreturn]] void fail(const std::string& what) const {
    throw SceneError(description_.where, fmt::format("medium \"{}\": {}", description_.name, what));
  }

 private:
  const MediumDescription& description_;
  std::vector<std::string>& notes_;
};

}  // namespace

/// Fills a medium from the description of its kind.
struct Medium::Builder {
  Medium& medium;
  const Checks& checks;
  DMat4 render_from_medium;
  float inverse_scale;

  void set_unit(Rgb sigma_a, Rgb sigma_s, float g) {
    checks.coefficient(sigma_a, "sigma_a");
    checks.coefficient(sigma_s, "sigma_s");
    medium.unit_ = {sigma_a * inverse_scale, sigma_s * inverse_scale, Rgb(0)};
    medium.unit_sigma_t_ = medium.unit_.sigma_t();
    medium.phase_.g = checks.mean_cosine(g);
    const Rgb t = medium.unit_sigma_t_;
    medium.grey_ = t.x == t.y && t.y == t.z;
  }

  void operator()(const HomogeneousDescription& d) {
    set_unit(d.sigma_a, d.sigma_s, d.g);
    checks.coefficient(d.emission, "Le");
    medium.unit_.emission = medium.unit_.sigma_a * d.emission;
    medium.maximum_sigma_t_ = max_component(medium.unit_sigma_t_);
    medium.scatters_ = !is_black(medium.unit_.sigma_s);
    medium.emits_ = !is_black(medium.unit_.emission);
  }

  FloatField field(const FloatVolume& volume, const char* name) {
    if (const auto* dense = std::get_if<DenseGrid<float>>(&volume))
      return DenseField<float>(checks.without_negatives(*dense, name), render_from_medium);
    checks.fail("sparse grids are not supported");
  }

  void operator()(const GridMediumDescription& d) {
    medium.kind_ = Kind::kGrid;
    set_unit(d.sigma_a, d.sigma_s, d.g);
    checks.coefficient(d.emission, "Le");
    medium.density_ = field(*d.density, "density");
    bound_density(std::get<DenseField<float>>(medium.density_));
    medium.scatters_ = medium.attenuates() && !is_black(medium.unit_.sigma_s);
    set_emission(d);
  }

  void set_emission(const GridMediumDescription& d) {
    GridEmission& e = medium.emission_;
    e.radiance = d.emission;
    e.scale = d.emission_scale;
    e.temperature_scale = d.temperature_scale;
    e.temperature_offset = d.temperature_offset;
    e.temperature_cutoff = d.temperature_cutoff;
    medium.emits_ = medium.attenuates() && !is_black(medium.unit_.sigma_a) && e.scale > 0 && !is_black(d.emission) && !d.temperature;
    if (d.temperature) checks.fail("temperature grids are not supported");
    if (medium.emits_ && d.emission_grid) e.scale_grid = field(*d.emission_grid, "Lescale");
  }

  void bound_density(const DenseField<float>& field) {
    MajorantGrid grid(field.size(), field.box(), field.map(), kFinestEdge);
    for (int z = 0; z < field.size().z; ++z)
      for (int y = 0; y < field.size().y; ++y)
        for (int x = 0; x < field.size().x; ++x) grid.add_voxel({x, y, z}, field.voxel(x, y, z));
    grid.scale(max_component(medium.unit_sigma_t_));
    set_majorants(std::move(grid));
  }

  void set_majorants(MajorantGrid finest) {
    medium.majorants_ = choose_brick_edge(std::move(finest));
    medium.maximum_sigma_t_ = medium.majorants_.maximum();
  }

  void operator()(const RgbGridMediumDescription& d) {
    medium.kind_ = Kind::kRgbGrid;
    (void)d;
    checks.fail("RGB grids are not supported");
  }
  void operator()(const CloudMediumDescription&) { checks.fail("procedural clouds are not supported"); }
};

Medium::Medium(const MediumDescription& description, const DMat4& render_from_world, double scale, std::vector<std::string>& notes) {
  const Checks checks(description, notes);
  const DMat4 render_from_medium = render_from_world * description.world_from_medium;
  if (const double det = glm::determinant(render_from_medium); !(std::abs(det) > 0) || !std::isfinite(det))
    checks.fail("its transform cannot be inverted");
  std::visit(Builder{*this, checks, render_from_medium, static_cast<float>(1 / scale)}, description.kind);
}

Rgb Medium::GridEmission::at(Vec3 p) const {
  const float s = scale_grid ? scale * std::visit([p](const auto& field) { return field.at(p); }, *scale_grid) : scale;
  return radiance * s;
}

MediumPoint Medium::at(Vec3 p) const {
  if (kind_ == Kind::kHomogeneous) return unit_;
  if (kind_ == Kind::kGrid) {
    const float d = density(p);
    MediumPoint point{unit_.sigma_a * d, unit_.sigma_s * d, Rgb(0)};
    if (emits_ && d > 0) point.emission = point.sigma_a * emission_.at(p);
    return point;
  }
  MediumPoint point{rgb_sigma_a_.at(p), rgb_sigma_s_.at(p), Rgb(0)};
  if (emits_) point.emission = point.sigma_a * rgb_emission_.at(p);
  return point;
}

Media::Media(const SceneDescription& scene, const DMat4& render_from_world, double scale) {
  media_.reserve(scene.media.size());
  for (const MediumDescription& description : scene.media) media_.emplace_back(description, render_from_world, scale, notes_);
}

Rgb albedo(const MediumPoint& point) {
  const Rgb t = point.sigma_t();
  Rgb result{0};
  for (int i = 0; i < 3; ++i)
    if (t[i] > 0) result[i] = point.sigma_s[i] / t[i];
  return result;
}

}  // namespace woodcock
