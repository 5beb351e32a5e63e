#include "renderer/scene/emission_checks.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>

namespace woodcock {

namespace {

/// Less than this of an emission whose visible peak is about 100 is as good as nothing.
constexpr float kFaintest = 1e-9f;

template <typename T>
bool has_values(const DenseGrid<T>& grid) {
  return !grid.values.empty();
}
bool is_zero(float value) { return !(value > 0); }
bool is_zero(const Rgb& value) { return is_black(value); }

template <typename T>
bool is_all_zero(const DenseGrid<T>& grid) {
  return std::all_of(grid.values.begin(), grid.values.end(), [](const T& v) { return is_zero(v); });
}

/// The first of `names` that is given.
std::optional<std::string> first_given(Parameters& parameters, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (parameters.has(name)) return name;
  return std::nullopt;
}

void warn_dark(Parameters& parameters, const std::string& asked, const std::string& why) {
  parameters.context().warn(parameters.place(asked), fmt::format("{} emits nothing: {}", parameters.directive(), why));
}

/// The max_temperature temperature in kelvin; nothing where it is not known.
std::optional<float> hottest_of(const GridMediumDescription& medium) {
  const auto kelvin = [&](float value) { return (value - medium.temperature_offset) * medium.temperature_scale; };
  if (const auto* dense = std::get_if<DenseGrid<float>>(medium.temperature.get())) {
    if (!has_values(*dense)) return std::nullopt;
    const auto [low, high] = std::minmax_element(dense->values.begin(), dense->values.end());
    return std::max(kelvin(*low), kelvin(*high));
  }
  const auto& sparse = std::get<SparseGrid>(*medium.temperature);
  if (sparse.buffer == nullptr || medium.temperature_scale < 0) return std::nullopt;
  // Outside of its voxels the grid reads 0.
  return kelvin(std::max(sparse.maximum, 0.0f));
}

void check_temperature(Parameters& parameters, const GridMediumDescription& medium, const std::optional<std::string>& asked) {
  const std::optional<float> max_temperature = hottest_of(medium);
  if (!max_temperature) return;
  const std::string place = asked.value_or("filename");
  const std::string numbers = fmt::format(
      "the max_temperature voxel of its temperatures is {:.6g} K (temperaturescale {:.6g}, temperatureoffset {:.6g})", *max_temperature,
      medium.temperature_scale, parameters.number("temperatureoffset", parameters.number("temperaturecutoff", 0)));
  if (!(*max_temperature > medium.temperature_cutoff)) {
    warn_dark(
        parameters, place,
        fmt::format("{}, and nothing at or below {:g} K emits; temperatures are in kelvin, \"float temperaturescale\" multiplies those of "
                    "the grid",
                    numbers, medium.temperature_cutoff));
    return;
  }
  const float emission = max_component(blackbody_emission(*max_temperature)) * max_component(medium.emission) * medium.emission_scale;
  if (asked && emission < kFaintest)
    parameters.context().warn(parameters.place(place),
                              fmt::format("{} emits as good as nothing: {}, which emits {:.1g}; what is seen begins "
                                          "at about 800 K, and \"Lescale\" multiplies it",
                                          parameters.directive(), numbers, emission));
}

}  // namespace

void warn_if_empty(Parameters& parameters, const FloatVolume& density) {
  const auto warn = [&](const std::string& what) {
    parameters.context().warn(parameters.place(parameters.has("density") ? "density" : "filename"),
                              fmt::format("{} is empty: {}", parameters.directive(), what));
  };
  if (const auto* dense = std::get_if<DenseGrid<float>>(&density)) {
    if (has_values(*dense) && is_all_zero(*dense)) warn(fmt::format("its density is 0 in all {} voxels", dense->values.size()));
    return;
  }
  const auto& sparse = std::get<SparseGrid>(density);
  if (sparse.buffer == nullptr) return;
  if (sparse.index_max.x < sparse.index_min.x)
    warn("its density has no active voxels");
  else if (!(sparse.maximum > 0))
    warn("its density is 0 in all active voxels");
}

void warn_if_empty(Parameters& parameters, const RgbGridMediumDescription& medium) {
  const auto zero = [](const std::shared_ptr<const RgbVolume>& grid) { return grid && has_values(*grid) && is_all_zero(*grid); };
  // A grid that is not given is 1 everywhere.
  if (zero(medium.sigma_a) && zero(medium.sigma_s))
    parameters.context().warn(parameters.place("sigma_a"), fmt::format("{} is empty: sigma_a and sigma_s are 0 in all {} voxels",
                                                                       parameters.directive(), medium.sigma_a->values.size()));
}

void warn_if_dark(Parameters& parameters, const HomogeneousDescription& medium) {
  if (parameters.has("Lescale") && !parameters.has("Le"))
    warn_dark(parameters, "Lescale", "\"Lescale\" multiplies \"Le\", which is not given");
  else if (!is_black(medium.emission) && is_black(medium.sigma_a))
    warn_dark(parameters, "Le", "a medium emits sigma_a * Le, and its sigma_a is 0");
}

void warn_if_dark(Parameters& parameters, const GridMediumDescription& medium) {
  const auto asked = first_given(
      parameters, {"Lescale", "Le", "temperature", "temperaturename", "temperaturescale", "temperatureoffset", "temperaturecutoff"});
  if (parameters.context().options.skip_payload || medium.emission_scale == 0) return;
  if (!medium.temperature && is_black(medium.emission)) {
    if (asked && *asked != "Le") warn_dark(parameters, *asked, "there is neither \"Le\" nor a grid of temperatures");
    return;
  }
  if (is_black(medium.emission)) return;
  if (is_black(medium.sigma_a)) {
    if (asked) warn_dark(parameters, *asked, "a medium emits sigma_a * Le, and its sigma_a is 0");
    return;
  }
  const auto* scales = medium.emission_grid ? std::get_if<DenseGrid<float>>(medium.emission_grid.get()) : nullptr;
  if (scales && has_values(*scales) && is_all_zero(*scales)) {
    warn_dark(parameters, "Lescale", fmt::format("\"Lescale\" is 0 in all {} voxels", scales->values.size()));
    return;
  }
  if (medium.temperature) check_temperature(parameters, medium, asked);
}

void warn_if_dark(Parameters& parameters, const RgbGridMediumDescription& medium) {
  if (!medium.emission) {
    if (parameters.has("Lescale")) warn_dark(parameters, "Lescale", "\"Lescale\" multiplies \"Le\", which is not given");
    return;
  }
  if (medium.emission_scale == 0 || !has_values(*medium.emission)) return;
  if (is_all_zero(*medium.emission)) {
    warn_dark(parameters, "Le", fmt::format("\"Le\" is 0 in all {} voxels", medium.emission->values.size()));
    return;
  }
  if (!medium.sigma_a || !has_values(*medium.sigma_a)) return;
  const auto& sigma_a = medium.sigma_a->values;
  bool emits = false;
  for (size_t i = 0; i < sigma_a.size(); ++i) emits = emits || !is_black(sigma_a[i] * medium.emission->values[i]);
  if (!emits) warn_dark(parameters, "Le", "a medium emits sigma_a * Le, and sigma_a is 0 in every voxel where Le is not");
}

}  // namespace woodcock
