// Compiling the description of one medium.
#include "renderer/media/medium.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "renderer/media/grid_mean.h"
#include "renderer/scene/phase_checks.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

/// The finest bricks that are considered, in cells.
constexpr int kFinestEdge = 4;
/// Large sparse volumes start with coarser bricks than that: 64 MiB of bounds.
constexpr double kMaxBricks = 1 << 24;
/// A ray takes a step for each unit of optical depth of the bound: beyond this it would take minutes, or not end.
constexpr double kMaxDepth = 1e9;

bool has_equal_channels(Rgb c) { return c.x == c.y && c.y == c.z; }
double mean_channel(Rgb c) { return (static_cast<double>(c.x) + static_cast<double>(c.y) + static_cast<double>(c.z)) / 3; }

template <typename F>
void for_each_voxel(IVec3 size, F f) {
  for (int z = 0; z < size.z; ++z)
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x) f(IVec3(x, y, z));
}

/// Checks the coefficients of a medium, where messages need to say whose they are.
class Checks {
 public:
  Checks(const MediumDescription& description, std::vector<std::string>& notes) : description_(description), notes_(notes) {}

  void coefficient(Rgb value, const char* name) const {
    if (!is_finite(value) || value.x < 0 || value.y < 0 || value.z < 0)
      fail(fmt::format("{} is ({}, {}, {}); it must be finite and not negative", name, value.x, value.y, value.z));
  }
  PhaseFunction phase(const PhaseDescription& phase) const {
    if (const auto fault = phase_fault(phase)) fail("found " + *fault);
    PhaseFunction result = make_phase_function(phase);
    constexpr double kSpelling = 1e-3;  // what rounding of the numbers in a file may do
    if (const auto* table = std::get_if<TabulatedPhase>(&result); table && std::abs(table->given_integral() - 1) > kSpelling)
      notes_.push_back(fmt::format("medium \"{}\": its phase function integrates to {:.4g} over the sphere and is divided by that",
                                   description_.name, table->given_integral()));
    return result;
  }
  /// As many values as voxels: a description read without its payload cannot be compiled.
  template <typename T>
  void complete(const DenseGrid<T>& grid, const char* name) const {
    if (const auto expected = static_cast<size_t>(grid.size.x) * static_cast<size_t>(grid.size.y) * static_cast<size_t>(grid.size.z);
        grid.values.size() != expected)
      fail(fmt::format("the {} grid holds {} values for {} voxels", name, grid.values.size(), expected));
  }
  void finite(const DenseGrid<float>& grid, const char* name) const {
    complete(grid, name);
    if (!std::all_of(grid.values.begin(), grid.values.end(), [](float v) { return std::isfinite(v); }))
      fail(fmt::format("the {} grid holds a value that is not finite", name));
  }
  /// A copy of a grid in which negative values, which interpolation and filtering of simulations leave behind, are 0.
  template <typename T>
  DenseGrid<T> without_negatives(const DenseGrid<T>& grid, const char* name) const {
    complete(grid, name);
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
  TransferTerms terms;
  Rgb unit_sigma_a{0};           ///< σa at density 1, whatever the terms
  Rgb whole{0};                  ///< σa + σs at density 1, whatever the terms
  bool may_emit = false;         ///< keep the finest bounds
  MajorantGrid finest_bounds{};  ///< for the bricks of emission

  void set_unit(Rgb sigma_a, Rgb sigma_s, const PhaseDescription& phase) {
    checks.coefficient(sigma_a, "sigma_a");
    checks.coefficient(sigma_s, "sigma_s");
    const Rgb a = sigma_a * inverse_scale, s = sigma_s * inverse_scale;
    whole = a + s;
    unit_sigma_a = a;
    medium.unit_ = {(terms.absorption ? a : Rgb(0)) + (terms.out_scattering ? s : Rgb(0)), terms.in_scattering ? s : Rgb(0), Rgb(0)};
    medium.phase_ = checks.phase(phase);
    medium.grey_ = has_equal_channels(medium.unit_.sigma_t);
  }

  /// After the majorant is known: a medium with a unit scatters and attenuates where its density is positive.
  void set_effects_of_unit(double mean_density) {
    medium.mean_sigma_t_ = mean_density * mean_channel(medium.unit_.sigma_t);
    const bool filled = medium.maximum_sigma_t_ > 0;
    medium.attenuates_ = filled && !is_black(medium.unit_.sigma_t);
    medium.scatters_ = filled && !is_black(medium.unit_.sigma_s);
  }

  void operator()(const HomogeneousDescription& d) {
    set_unit(d.sigma_a, d.sigma_s, d.phase);
    checks.coefficient(d.emission, "Le");
    if (terms.emission) medium.unit_.emission = unit_sigma_a * d.emission;
    medium.maximum_sigma_t_ = max_component(whole);
    set_effects_of_unit(1);
    medium.emits_ = !is_black(medium.unit_.emission);
  }

  SparseField sparse_field(const SparseGrid& grid, const char* name, SparseField::Values values = SparseField::Values::kNotNegative) {
    try {
      SparseField field(grid, render_from_medium, values);
      if (field.non_finite_values() != 0)
        checks.fail(fmt::format("the {} grid holds {} values that are not finite", name, field.non_finite_values()));
      checks.note_negative(field.negative_values(), name);
      return field;
    } catch (const std::length_error& error) {
      checks.fail(fmt::format("the {} grid cannot be unpacked: {}", name, error.what()));
    }
  }

  BrickField<float> field(const FloatVolume& volume, const char* name) {
    if (const auto* dense = std::get_if<DenseGrid<float>>(&volume)) return {checks.without_negatives(*dense, name), render_from_medium};
    return sparse_field(std::get<SparseGrid>(volume), name);
  }

  void operator()(const GridMediumDescription& d) {
    auto& filled = medium.kind_.emplace<Grid>();
    set_unit(d.sigma_a, d.sigma_s, d.phase);
    filled.unit_sigma_a = unit_sigma_a;
    checks.coefficient(d.emission, "Le");
    may_emit = terms.emission && !is_black(d.emission) && !is_black(d.sigma_a);
    double mean_density = 0;
    if (const auto* dense = std::get_if<DenseGrid<float>>(d.density.get())) {
      const DenseGrid<float> grid = checks.without_negatives(*dense, "density");
      BrickField<float> density(grid, render_from_medium);
      bound(grid, density);
      mean_density = grid_mean(grid.size, density.box(), [&](IVec3 v) { return grid.at(v.x, v.y, v.z); });
      filled.density = std::move(density);
    } else {
      const auto& grid = std::get<SparseGrid>(*d.density);
      SparseField density = sparse_field(grid, "density");
      if (d.temperature) extend_to(density, grid, *d.temperature);
      bound(density);
      mean_density = density.mean();
      filled.density = BrickField<float>(std::move(density));
    }
    set_effects_of_unit(mean_density);
    set_emission(d, filled.emission);
    set_emission_importance();
  }

  /// pbrt-v4 ends a NanoVDB medium at the union of the boxes of its density and its temperature. For grids whose maps
  /// are rotated, where that union is no box of cells, the density's own box stays.
  void extend_to(SparseField& density, const SparseGrid& grid, const FloatVolume& temperature) const {
    const auto* other = std::get_if<SparseGrid>(&temperature);
    if (other == nullptr || other->index_max.x < other->index_min.x || grid.index_max.x < grid.index_min.x) return;
    const DMat4 density_from_other = glm::inverse(grid.medium_from_index) * other->medium_from_index;
    for (int column = 0; column < 3; ++column)
      for (int row = 0; row < 3; ++row)
        if (row != column && std::abs(density_from_other[column][row]) > 1e-12 * std::abs(density_from_other[column][column])) return;
    const auto to_density = [&](IVec3 index) { return DVec3(density_from_other * glm::dvec4(DVec3(index), 1)) - DVec3(grid.index_min); };
    const DVec3 a = to_density(other->index_min), b = to_density(other->index_max + 1);
    // The density's own box starts at its sample index_min.
    const CellBox box = density.box();
    density.set_box({glm::min(box.lower, box.lower + glm::min(a, b)), glm::max(box.upper, box.lower + glm::max(a, b))});
  }

  void set_emission(const GridMediumDescription& d, GridEmission& e) {
    e.radiance = d.emission;
    e.scale = d.emission_scale;
    if (!(e.scale >= 0) || !std::isfinite(e.scale)) checks.fail(fmt::format("Lescale is {}; it must be finite and not negative", e.scale));
    if (!terms.emission || !(medium.maximum_sigma_t_ > 0)) return;
    if (is_black(unit_sigma_a) || is_black(e.radiance) || e.scale == 0) return;
    if (d.temperature) {
      e.temperature_scale = d.temperature_scale;
      e.temperature_offset = d.temperature_offset;
      e.temperature_cutoff = d.temperature_cutoff;
      if (!(max_temperature(*d.temperature, e) > e.temperature_cutoff)) return;
      e.temperature = temperature_field(*d.temperature);
    }
    if (d.emission_grid) e.scale_grid = field(*d.emission_grid, "Lescale");
    medium.emits_ = true;
  }

  /// A bound of the temperatures in kelvin, infinite where none is known.
  static float max_temperature(const FloatVolume& volume, const GridEmission& e) {
    const auto* dense = std::get_if<DenseGrid<float>>(&volume);
    if (!(e.temperature_scale > 0)) return kInf;
    // Where the grid has no values it reads 0, before scale and offset.
    if (dense == nullptr) return e.kelvin(std::max(0.0f, std::get<SparseGrid>(volume).maximum));
    float largest = 0;
    for (const float value : dense->values) largest = std::max(largest, value);
    return e.kelvin(largest);
  }

  /// Temperatures may be negative before the offset is taken away.
  BrickField<float> temperature_field(const FloatVolume& volume) {
    if (const auto* dense = std::get_if<DenseGrid<float>>(&volume)) {
      checks.finite(*dense, "temperature");
      return {*dense, render_from_medium};
    }
    SparseField sparse = sparse_field(std::get<SparseGrid>(volume), "temperature", SparseField::Values::kAnySign);
    // Only the density's box ends a medium.
    sparse.set_box({DVec3(-1e9), DVec3(1e9)});
    return BrickField<float>(std::move(sparse));
  }

  void bound(const DenseGrid<float>& values, const BrickField<float>& density) {
    MajorantGrid grid(values.size, density.box(), density.map(), kFinestEdge);
    for_each_voxel(values.size, [&](IVec3 v) { grid.add_voxel(v, values.at(v.x, v.y, v.z)); });
    grid.scale(max_component(whole), min_component(medium.unit_.sigma_t));
    set_majorants(std::move(grid));
  }

  void bound(const SparseField& density) {
    int edge = kFinestEdge;
    const auto bricks = [&] {
      return static_cast<double>(density.voxels().x) / edge * density.voxels().y / edge * density.voxels().z / edge;
    };
    while (bricks() > kMaxBricks) edge *= 2;
    MajorantGrid grid(density.voxels(), density.box(), density.map(), edge);
    density.add_bounds(grid);
    grid.scale(max_component(whole), min_component(medium.unit_.sigma_t));
    set_majorants(std::move(grid));
  }

  void set_majorants(MajorantGrid finest) {
    if (may_emit) finest_bounds = finest;
    medium.majorants_ = choose_brick_edge(std::move(finest));
    medium.maximum_sigma_t_ = medium.majorants_.maximum();
    const double depth = static_cast<double>(medium.maximum_sigma_t_) * medium.diagonal();
    if (!(depth <= kMaxDepth))
      checks.fail(
          fmt::format("its largest extinction is {:.3g} per unit of length, an optical depth of {:.3g} across the box; "
                      "expected at most {:.0e}, since tracking takes a step for each unit of it: lower the scale, or the "
                      "outliers of the grid",
                      medium.maximum_sigma_t_ / inverse_scale, depth, kMaxDepth));
  }

  void set_emission_importance() {
    if (!medium.emits_) return;
    const MajorantGrid& majorants = medium.majorants_;
    MajorantGrid largest(finest_bounds.size() * finest_bounds.edge(), majorants.box(), majorants.map(), majorants.edge());
    medium.emission_importance_ = std::make_shared<const EmissionImportance>(
        std::move(finest_bounds), [this](DVec3 p) { return mean_channel(medium.at(p).emission); }, largest);
    largest.scale(1, 0);
    largest.follow(majorants);
    medium.largest_emission_ = std::move(largest);
  }

  void operator()(const RgbGridMediumDescription& d) {
    auto& rgb = medium.kind_.emplace<RgbGrid>();
    medium.phase_ = checks.phase(d.phase);
    checks.coefficient(Rgb(d.scale), "scale");
    checks.coefficient(Rgb(d.emission_scale), "Lescale");
    if (!d.sigma_a && !d.sigma_s) checks.fail("neither sigma_a nor sigma_s is given; an rgbgrid needs one of them");
    const IVec3 size = d.sigma_a ? d.sigma_a->size : d.sigma_s->size;
    const float scale = d.scale * inverse_scale;
    const auto checked = [&](const std::shared_ptr<const RgbVolume>& volume, const char* name) -> std::optional<RgbVolume> {
      if (!volume) return std::nullopt;
      if (volume->size != size) checks.fail(fmt::format("its {} grid has another resolution than the others", name));
      return checks.without_negatives(*volume, name);
    };
    const std::optional<RgbVolume> sigma_a = checked(d.sigma_a, "sigma_a"), sigma_s = checked(d.sigma_s, "sigma_s"),
                                   emission = checked(d.emission, "Le");
    rgb.absent = Rgb(scale);
    rgb.terms = terms;
    if (sigma_a) rgb.sigma_a.emplace(*sigma_a, render_from_medium, scale);
    if (sigma_s) rgb.sigma_s.emplace(*sigma_s, render_from_medium, scale);
    if (emission) rgb.emission.emplace(*emission, render_from_medium, d.emission_scale);

    const BrickField<Rgb>& shape = rgb.sigma_a ? *rgb.sigma_a : *rgb.sigma_s;
    MajorantGrid grid(size, shape.box(), shape.map(), kFinestEdge);
    medium.grey_ = true;
    bool has_emission = false;
    for_each_voxel(size, [&](IVec3 v) {
      const auto value = [&](const std::optional<RgbVolume>& volume) { return volume ? volume->at(v.x, v.y, v.z) * scale : Rgb(scale); };
      const Rgb a = value(sigma_a), s = value(sigma_s);
      const Rgb sigma_t = rgb.sigma_t_of(a, s);
      grid.add_voxel(v, max_component(a + s), min_component(sigma_t));
      // Each by itself: the interpolants of a and s are rounded before they are added.
      medium.grey_ = medium.grey_ && (!terms.absorption || has_equal_channels(a)) && (!terms.out_scattering || has_equal_channels(s));
      medium.attenuates_ = medium.attenuates_ || !is_black(sigma_t);
      medium.scatters_ = medium.scatters_ || (terms.in_scattering && !is_black(s));
      medium.emits_ = medium.emits_ || !is_black(a);
      has_emission = has_emission || (emission && d.emission_scale > 0 && !is_black(emission->at(v.x, v.y, v.z)));
    });
    medium.emits_ = medium.emits_ && has_emission && terms.emission;
    grid.scale(1, 1);
    may_emit = medium.emits_;
    set_majorants(std::move(grid));
    const auto mean_of = [&](const std::optional<RgbVolume>& volume) {
      if (!volume) return mean_channel(rgb.absent);
      return static_cast<double>(scale) * grid_mean(size, shape.box(), [&](IVec3 v) { return mean_channel(volume->at(v.x, v.y, v.z)); });
    };
    medium.mean_sigma_t_ = (terms.absorption ? mean_of(sigma_a) : 0) + (terms.out_scattering ? mean_of(sigma_s) : 0);
    set_emission_importance();
  }

  void operator()(const CloudMediumDescription& d) {
    auto& filled = medium.kind_.emplace<Grid>();
    set_unit(d.sigma_a, d.sigma_s, d.phase);
    for (int i = 0; i < 3; ++i)
      if (!(d.p1[i] > d.p0[i])) checks.fail("the box p0 .. p1 of the cloud is empty");
    const CloudField cloud(d, render_from_medium);
    // The density has no bound but 1 that holds everywhere: one brick.
    MajorantGrid grid(IVec3(1), {DVec3(0), DVec3(1)}, cloud.map(), 1);
    grid.add_voxel(IVec3(0), 1);
    grid.scale(max_component(whole), min_component(medium.unit_.sigma_t));
    set_majorants(std::move(grid));
    set_effects_of_unit(cloud.mean());
    filled.density = cloud;
  }

  void operator()(const SumMediumDescription&) const { checks.fail("a sum is made of other media and cannot be compiled without them"); }
};

Medium::Medium(const MediumDescription& description, const DMat4& render_from_world, double scale, std::vector<std::string>& notes,
               const TransferTerms& terms) {
  const Checks checks(description, notes);
  const DMat4 render_from_medium = render_from_world * description.world_from_medium;
  if (const double det = glm::determinant(render_from_medium); !(std::abs(det) > 0) || !std::isfinite(det))
    checks.fail("its transform cannot be inverted");
  std::visit(Builder{*this, checks, render_from_medium, static_cast<float>(1 / scale), terms}, description.kind);
}

}  // namespace woodcock
