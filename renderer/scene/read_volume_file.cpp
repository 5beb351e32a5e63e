// The medium types "nanovdb" and "openvdb".
#include <algorithm>

#include "renderer/scene/emission_checks.h"
#include "renderer/scene/limits.h"
#include "renderer/scene/read_media_parts.h"
#include "renderer/scene/scene_error.h"
#include "renderer/scene/text_file.h"
#include "renderer/scene/volume_files.h"

namespace woodcock {

namespace {

/// One volume file, and the place that names it.
class VolumeFile {
 public:
  VolumeFile(const std::string& kind, Parameters& parameters)
      : parameters_(parameters), path_(parameters.file("filename")), where_(parameters.place("filename")) {
    if (path_.empty())
      throw SceneError(where_, "found " + parameters.directive() + " without \"string filename\", expected the path of a volume file");
    SceneFiles& files = parameters.context().files;
    bytes_ = files.read(path_, limits::kFileBytes, where_);
    name_ = files.display_name(path_);
    const std::optional<VolumeFormat> format = volume_format(bytes_);
    if (!format)
      throw SceneError(where_, "found \"" + name_ + "\" for " + parameters.directive() +
                                   ", whose first bytes are of neither NanoVDB nor OpenVDB" +
                                   (is_gzip(bytes_) ? ": it is packed with gzip; unpack it" : "; expected one of the two"));
    format_ = *format;
    if (kind == "openvdb" && format_ != VolumeFormat::kOpenVdb)
      throw SceneError(where_, "found the NanoVDB file \"" + name_ +
                                   "\" for a medium of type \"openvdb\", expected an OpenVDB file; \"nanovdb\" reads both");
    entries_ = format_ == VolumeFormat::kOpenVdb ? list_openvdb(bytes_, name_, where_) : list_nanovdb(bytes_, name_, where_);
  }

  struct Grid {
    std::shared_ptr<const FloatVolume> volume;
    float background = 0;
  };
  /// The grid of that name; nothing where the file has none.
  std::optional<Grid> load(const std::string& grid_name, GridMeaning meaning) const {
    ReadContext& context = parameters_.context();
    auto read = format_ == VolumeFormat::kOpenVdb ? read_openvdb(bytes_, grid_name, meaning, name_, where_)
                                                  : read_nanovdb(bytes_, grid_name, meaning, context.options.skip_payload, name_, where_);
    if (!read) return std::nullopt;
    const auto count = std::count_if(entries_.begin(), entries_.end(), [&](const VolumeEntry& e) { return e.name == grid_name; });
    if (count > 1)
      context.warn(where_,
                   "\"" + name_ + "\" holds " + std::to_string(count) + " grids of the name \"" + grid_name + "\"; the first one is read");
    if (read->negative)
      context.warn(where_, std::to_string(read->negative) + " negative values of grid \"" + grid_name + "\" are taken as 0");
    if (context.options.skip_payload) read->grid.buffer = nullptr;
    return Grid{std::make_shared<const FloatVolume>(std::move(read->grid)), read->background};
  }

  /// `"density" (float) "flames" (vec3s)`, and what the name may have meant.
  std::string holds(const std::string& wanted) const {
    constexpr size_t kShown = 40;
    std::string text;
    std::vector<std::string> names;
    for (const VolumeEntry& e : entries_) {
      if (names.size() < kShown) text += " \"" + e.name + "\" (" + e.type + ")";
      names.push_back(e.name);
    }
    return (text.empty() ? " no grids" : text) + "." + suggestion(wanted, names);
  }

  const std::string& name() const { return name_; }

 private:
  Parameters& parameters_;
  std::filesystem::path path_;
  SourceLocation where_;
  std::string bytes_, name_;
  VolumeFormat format_ = VolumeFormat::kNanoVdb;
  std::vector<VolumeEntry> entries_;
};

}  // namespace

GridMediumDescription read_volume_file(const std::string& kind, Parameters& parameters) {
  GridMediumDescription medium;
  const MediumCoefficients c = read_coefficients(parameters);
  medium.sigma_a = c.sigma_a;
  medium.sigma_s = c.sigma_s;
  medium.phase = read_phase(parameters);
  medium.emission_scale = read_emission_scale(parameters);
  read_temperature_scale(parameters, medium);
  const std::string density_name = parameters.string("gridname", "density");
  const std::string temperature_name = parameters.string("temperaturename", "temperature");
  const VolumeFile file(kind, parameters);
  const auto missing = [&](const std::string& parameter, const std::string& name) {
    return SceneError(parameters.place(parameters.has(parameter) ? parameter : "filename"),
                      "found no grid \"" + name + "\" in \"" + file.name() + "\", which holds" + file.holds(name) +
                          " Name one with \"string " + parameter + "\"");
  };
  const auto density = file.load(density_name, GridMeaning::kDensity);
  if (!density) throw missing("gridname", density_name);
  medium.density = density->volume;
  const auto temperature = file.load(temperature_name, GridMeaning::kTemperature);
  if (!temperature && parameters.has("temperaturename")) throw missing("temperaturename", temperature_name);
  if (temperature) {
    medium.temperature = temperature->volume;
    medium.temperature_offset -= temperature->background;
    medium.emission = Rgb(1);
  }
  warn_if_empty(parameters, *medium.density);
  if (temperature) {
    warn_if_dark(parameters, medium);
    return medium;
  }
  for (const char* name : {"Lescale", "temperaturescale", "temperatureoffset", "temperaturecutoff"}) {
    if (!parameters.has(name) || medium.emission_scale == 0) continue;
    parameters.context().warn(parameters.place(name), parameters.directive() + " emits nothing: there is no grid \"" + temperature_name +
                                                          "\" in \"" + file.name() + "\", which holds" + file.holds(temperature_name) +
                                                          " Name one with \"string temperaturename\"");
    break;
  }
  return medium;
}

}  // namespace woodcock
