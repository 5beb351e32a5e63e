// The parameter list of one directive, read strictly: whatever the reader did not ask for is an error.
#pragma once

#include <initializer_list>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "renderer/scene/colorimetry.h"
#include "renderer/scene/description.h"
#include "renderer/scene/read_context.h"

namespace woodcock {

/// `"type name" values` as it stands in the file. Booleans are the strings "true" and "false".
struct Parameter {
  std::string type, name;
  SourceLocation where;
  std::filesystem::path folder;  ///< of the file it stands in, to resolve file names
  std::vector<double> numbers;
  std::vector<std::string> strings;
};
using ParameterList = std::vector<Parameter>;

/// Reads parameters by name and type. Each getter makes its name known; `finish` then reports names nobody asked for.
/// All getters throw SceneError for a wrong type, a wrong count or an impossible value.
class Parameters {
 public:
  /// `directive` as in `Shape "sphere"`. `defaults` come from `Attribute` directives: they may go unused.
  Parameters(ReadContext& context, std::string directive, SourceLocation where, ParameterList given,
             std::shared_ptr<const ParameterList> defaults = nullptr);

  bool has(const std::string& name);
  double number(const std::string& name, double otherwise);
  float real(const std::string& name, float otherwise);
  /// Refused outside [lowest, highest].
  double number_within(const std::string& name, double otherwise, double lowest, double highest);
  int integer(const std::string& name, int otherwise, int lowest = -2147483647, int highest = 2147483647);
  bool boolean(const std::string& name, bool otherwise);
  std::string string(const std::string& name, const std::string& otherwise);
  /// One of `choices`, else an error that lists them.
  std::string choice(const std::string& name, const std::string& otherwise, const std::vector<std::string>& choices);
  /// The canonical path of an existing file, or empty when absent.
  std::filesystem::path file(const std::string& name);

  std::vector<double> numbers(const std::string& name, std::optional<size_t> count = std::nullopt);
  std::vector<int> integers(const std::string& name, std::optional<size_t> count = std::nullopt);
  std::vector<std::string> strings(const std::string& name, std::optional<size_t> count = std::nullopt);
  std::vector<DVec3> points(const std::string& name);
  std::vector<DVec2> points2(const std::string& name);
  std::vector<Vec3> normals(const std::string& name);
  std::vector<Rgb> colors(const std::string& name);
  DVec3 point(const std::string& name, DVec3 otherwise);
  DVec3 vector(const std::string& name, DVec3 otherwise);

  /// A colour from rgb, spectrum (name, file or wavelength-value pairs) or blackbody; absent means nullopt.
  std::optional<Rgb> color(const std::string& name, SpectrumUse use);
  FloatParameter float_or_texture(const std::string& name, float otherwise);
  std::optional<FloatParameter> optional_float_or_texture(const std::string& name);
  RgbParameter color_or_texture(const std::string& name, Rgb otherwise, SpectrumUse use);
  std::optional<RgbParameter> optional_color_or_texture(const std::string& name, SpectrumUse use);
  /// An index of refraction: a float, or a spectrum taken at 587.6 nm (Fraunhofer d).
  float refraction_index(const std::string& name, float otherwise);

  /// A parameter pbrt-v4 knows and Woodcock cannot honour; `changes_picture` decides between error and warning.
  void refuse(const std::string& name, bool changes_picture, const std::string& advice = "");

  /// Throws for parameters that no getter asked for.
  void finish();

  /// The place of parameter `name`, else of the directive.
  SourceLocation place(const std::string& name) const;
  const SourceLocation& where() const { return where_; }
  const std::string& directive() const { return directive_; }
  ReadContext& context() const { return context_; }

 private:
  const Parameter* find(const std::string& name, std::initializer_list<const char*> types);
  const Parameter* lookup(const std::string& name) const;
  void expect_count(const Parameter& parameter, size_t count) const;
  std::vector<double> tuples(const std::string& name, std::initializer_list<const char*> types, size_t size);
  Rgb color_value(const Parameter& parameter, SpectrumUse use);
  SampledSpectrum sampled_spectrum(const Parameter& parameter);
  [[noreturn]] void fail(const Parameter& parameter, const std::string& message) const;

  ReadContext& context_;
  std::string directive_;
  SourceLocation where_;
  ParameterList given_;
  std::shared_ptr<const ParameterList> defaults_;
  std::vector<std::string> known_;
};

/// The types a parameter may be declared with; an empty answer means unknown. "point" becomes "point3" and so on.
std::string canonical_type(std::string_view type);
std::vector<std::string> parameter_types();

}  // namespace woodcock
