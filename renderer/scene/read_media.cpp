// MakeNamedMedium.
#include <cmath>

#include "renderer/scene/emission_checks.h"
#include "renderer/scene/limits.h"
#include "renderer/scene/read_media_parts.h"
#include "renderer/scene/scattering_presets.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

MediumCoefficients read_coefficients(Parameters& parameters) {
  MediumCoefficients c;
  const auto sigma_a = parameters.color("sigma_a", SpectrumUse::kUnbounded);
  const auto sigma_s = parameters.color("sigma_s", SpectrumUse::kUnbounded);
  const std::string preset_name = parameters.string("preset", "");
  const float scale = static_cast<float>(parameters.number_within("scale", 1, 0, 1e30));
  if (!preset_name.empty()) {
    if (sigma_a || sigma_s)
      throw SceneError(parameters.place("preset"), "found \"preset\" beside \"sigma_a\" or \"sigma_s\" for " + parameters.directive() +
                                                       ", expected one of the two descriptions");
    const ScatteringPreset preset = scattering_preset(preset_name, parameters.place("preset"));
    c = {preset.sigma_a, preset.sigma_s};
  } else {
    c = {sigma_a.value_or(Rgb(1)), sigma_s.value_or(Rgb(1))};
  }
  c.sigma_a *= scale;
  c.sigma_s *= scale;
  if (!is_finite(c.sigma_a) || !is_finite(c.sigma_s))
    throw SceneError(parameters.where(), "found coefficients too large for a float in " + parameters.directive());
  return c;
}

float read_emission_scale(Parameters& parameters) { return static_cast<float>(parameters.number_within("Lescale", 1, 0, 1e30)); }

void read_temperature_scale(Parameters& parameters, GridMediumDescription& medium) {
  constexpr float kColdest = 100;
  medium.temperature_scale = parameters.real("temperaturescale", 1);
  const float cutoff = parameters.real("temperaturecutoff", 0);
  medium.temperature_offset = parameters.real("temperatureoffset", cutoff);
  medium.temperature_cutoff = kColdest;
}

namespace {

HomogeneousDescription read_homogeneous(Parameters& parameters) {
  HomogeneousDescription medium;
  const MediumCoefficients c = read_coefficients(parameters);
  medium.sigma_a = c.sigma_a;
  medium.sigma_s = c.sigma_s;
  medium.emission = read_emission_scale(parameters) * parameters.color("Le", SpectrumUse::kIlluminant).value_or(Rgb(0));
  medium.phase = read_phase(parameters);
  warn_if_dark(parameters, medium);
  return medium;
}

/// nx ny nz p0 p1.
template <typename Grid>
void read_box(Parameters& parameters, Grid& grid) {
  const auto side = [&](const char* name) { return parameters.integer(name, 1, 1, limits::kGridSide); };
  const int nx = side("nx"), ny = side("ny"), nz = side("nz");
  grid.size = {nx, ny, nz};
  if (int64_t{nx} * ny * nz > limits::kGridVoxels)
    throw SceneError(parameters.place("nx"), "found a grid of " + std::to_string(int64_t{nx} * ny * nz) + " voxels, expected at most " +
                                                 std::to_string(limits::kGridVoxels));
  grid.p0 = parameters.point("p0", DVec3(0));
  grid.p1 = parameters.point("p1", DVec3(1));
  for (int c = 0; c < 3; ++c)
    if (!(grid.p0[c] < grid.p1[c]))
      throw SceneError(parameters.place("p1"),
                       "found a grid whose p0 is not below its p1 along axis " + std::to_string(c) + " in " + parameters.directive());
}

void expect_voxels(Parameters& parameters, const std::string& name, size_t found, IVec3 size) {
  const size_t expected = static_cast<size_t>(size.x) * size.y * size.z;
  if (found != expected)
    throw SceneError(parameters.place(name), "found " + std::to_string(found) + " values of \"" + name + "\" for " +
                                                 parameters.directive() + ", expected nx * ny * nz = " + std::to_string(expected));
}

std::string voxel_name(size_t i, IVec3 size) {
  const size_t x = i % size.x, y = i / size.x % size.y, z = i / size.x / size.y;
  return "(" + std::to_string(x) + ", " + std::to_string(y) + ", " + std::to_string(z) + ")";
}

/// The values of float parameter `name` on `box`; absent gives nullptr. Values too large for a float are refused with the voxel's position,
/// negative ones too unless `signed_values`.
std::shared_ptr<const FloatVolume> read_dense(Parameters& parameters, const std::string& name, const DenseGrid<float>& box,
                                              bool signed_values) {
  if (!parameters.has(name)) return nullptr;
  const std::vector<double> values = parameters.numbers(name);
  expect_voxels(parameters, name, values.size(), box.size);
  DenseGrid<float> grid = box;
  size_t negative = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(static_cast<float>(values[i])))
      throw SceneError(parameters.place(name), "found a value that is not finite at voxel " + voxel_name(i, box.size) + " of \"" + name +
                                                   "\" in " + parameters.directive());
    if (values[i] < 0 && !signed_values) ++negative;
  }
  if (negative)
    parameters.context().warn(parameters.place(name), std::to_string(negative) + " negative values of \"" + name + "\" are taken as 0");
  if (!parameters.context().options.skip_payload) {
    grid.values.reserve(values.size());
    for (const double v : values) grid.values.push_back(static_cast<float>(signed_values ? v : std::max(v, 0.0)));
  }
  return std::make_shared<const FloatVolume>(std::move(grid));
}

GridMediumDescription read_uniform_grid(Parameters& parameters) {
  GridMediumDescription medium;
  DenseGrid<float> box;
  read_box(parameters, box);
  const MediumCoefficients c = read_coefficients(parameters);
  medium.sigma_a = c.sigma_a;
  medium.sigma_s = c.sigma_s;
  medium.phase = read_phase(parameters);
  medium.density = read_dense(parameters, "density", box, false);
  if (!medium.density)
    throw SceneError(parameters.where(), "found " + parameters.directive() + " without \"float density\", expected nx * ny * nz values");
  medium.temperature = read_dense(parameters, "temperature", box, true);
  medium.emission_grid = read_dense(parameters, "Lescale", box, false);
  read_temperature_scale(parameters, medium);
  const auto emission = parameters.color("Le", SpectrumUse::kIlluminant);
  if (emission && medium.temperature)
    throw SceneError(parameters.place("Le"),
                     "found both \"Le\" and \"temperature\" for " + parameters.directive() + ", expected one of them");
  medium.emission = emission.value_or(Rgb(medium.temperature ? 1.0f : 0.0f));
  warn_if_empty(parameters, *medium.density);
  warn_if_dark(parameters, medium);
  return medium;
}

RgbGridMediumDescription read_rgb_grid(Parameters& parameters) {
  RgbGridMediumDescription medium;
  RgbVolume box;
  read_box(parameters, box);
  const auto grid = [&](const std::string& name) -> std::shared_ptr<const RgbVolume> {
    if (!parameters.has(name)) return nullptr;
    std::vector<Rgb> values = parameters.colors(name);
    expect_voxels(parameters, name, values.size(), box.size);
    size_t negative = 0;
    for (size_t i = 0; i < values.size(); ++i) {
      if (!is_finite(values[i]))
        throw SceneError(parameters.place(name), "found a value that is not finite at voxel " + voxel_name(i, box.size) + " of \"" + name +
                                                     "\" in " + parameters.directive());
      if (min_component(values[i]) >= 0) continue;
      ++negative;
      values[i] = glm::max(values[i], Rgb(0));
    }
    if (negative)
      parameters.context().warn(parameters.place(name),
                                "negative values of \"" + name + "\" in " + std::to_string(negative) + " voxels are taken as 0");
    RgbVolume volume = box;
    if (!parameters.context().options.skip_payload) volume.values = std::move(values);
    return std::make_shared<const RgbVolume>(std::move(volume));
  };
  medium.sigma_a = grid("sigma_a");
  medium.sigma_s = grid("sigma_s");
  medium.emission = grid("Le");
  if (!medium.sigma_a && !medium.sigma_s)
    throw SceneError(parameters.where(),
                     "found " + parameters.directive() + " without \"rgb sigma_a\" and \"rgb sigma_s\", expected at least one of them");
  if (medium.emission && !medium.sigma_a)
    throw SceneError(parameters.place("Le"), "found \"Le\" without \"sigma_a\" for " + parameters.directive() + ", expected both");
  medium.scale = static_cast<float>(parameters.number_within("scale", 1, 0, 1e30));
  medium.emission_scale = read_emission_scale(parameters);
  medium.phase = read_phase(parameters);
  warn_if_empty(parameters, medium);
  warn_if_dark(parameters, medium);
  return medium;
}

CloudMediumDescription read_cloud(Parameters& parameters) {
  CloudMediumDescription cloud;
  const MediumCoefficients c = read_coefficients(parameters);
  cloud.sigma_a = c.sigma_a;
  cloud.sigma_s = c.sigma_s;
  cloud.phase = read_phase(parameters);
  cloud.density = static_cast<float>(parameters.number_within("density", 1, 0, 1e30));
  cloud.wispiness = static_cast<float>(parameters.number_within("wispiness", 1, -1e6, 1e6));
  cloud.frequency = static_cast<float>(parameters.number_within("frequency", 5, -1e6, 1e6));
  DenseGrid<float> box;
  box.p0 = parameters.point("p0", DVec3(0));
  box.p1 = parameters.point("p1", DVec3(1));
  for (int i = 0; i < 3; ++i)
    if (!(box.p0[i] < box.p1[i]))
      throw SceneError(parameters.place("p1"), "found a cloud whose p0 is not below its p1 along axis " + std::to_string(i));
  cloud.p0 = box.p0;
  cloud.p1 = box.p1;
  return cloud;
}

std::vector<std::string> read_summed(Parameters& parameters) {
  std::vector<std::string> names = parameters.strings("media");
  if (names.size() < 2 || names.size() > static_cast<size_t>(kMaxSummedMedia))
    throw SceneError(parameters.place("media"), "found " + std::to_string(names.size()) + " names of \"media\" for " +
                                                    parameters.directive() + ", expected 2 to " + std::to_string(kMaxSummedMedia));
  return names;
}

}  // namespace

std::optional<ReadMedium> read_medium(const std::string& kind, Parameters& parameters) {
  if (kind == "homogeneous") return ReadMedium{read_homogeneous(parameters), {}};
  if (kind == "uniformgrid") return ReadMedium{read_uniform_grid(parameters), {}};
  if (kind == "rgbgrid") return ReadMedium{read_rgb_grid(parameters), {}};
  if (kind == "nanovdb" || kind == "openvdb") return ReadMedium{read_volume_file(kind, parameters), {}};
  if (kind == "cloud") return ReadMedium{read_cloud(parameters), {}};
  if (kind == "sum") return ReadMedium{SumMediumDescription{}, read_summed(parameters)};
  refuse_kind(parameters.context(), parameters.place("type"), "MakeNamedMedium", kind,
              {"cloud", "homogeneous", "nanovdb", "openvdb", "rgbgrid", "sum", "uniformgrid"}, {});
  return std::nullopt;
}

}  // namespace woodcock
