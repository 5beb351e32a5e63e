#include "renderer/scene/parameters.h"

#include <algorithm>
#include <cmath>

#include "renderer/scene/lexer.h"
#include "renderer/scene/limits.h"
#include "renderer/scene/parameter_edits.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

std::string joined(std::initializer_list<const char*> types) {
  std::string text;
  for (const char* type : types) text += (text.empty() ? "" : " or ") + std::string(type);
  return text;
}

/// A double that fits a float, since everything but positions is stored as one.
bool fits_float(double value) { return std::abs(value) <= std::numeric_limits<float>::max(); }

}  // namespace

std::vector<std::string> parameter_types() {
  return {"integer", "float",  "bool", "string",   "point2",    "point3", "vector2",
          "vector3", "normal", "rgb",  "spectrum", "blackbody", "texture"};
}

std::string canonical_type(std::string_view type) {
  if (type == "point") return "point3";
  if (type == "vector") return "vector3";
  if (type == "normal3") return "normal";
  for (const std::string& known : parameter_types())
    if (type == known) return known;
  return "";
}

Parameters::Parameters(ReadContext& context, std::string directive, SourceLocation where, ParameterList given,
                       std::shared_ptr<const ParameterList> defaults)
    : context_(context),
      directive_(std::move(directive)),
      where_(std::move(where)),
      given_(std::move(given)),
      defaults_(std::move(defaults)) {
  std::vector<const std::string*> names;
  for (const Parameter& p : given_) names.push_back(&p.name);
  std::sort(names.begin(), names.end(), [](auto a, auto b) { return *a < *b; });
  const auto twice = std::adjacent_find(names.begin(), names.end(), [](auto a, auto b) { return *a == *b; });
  if (twice == names.end()) return;
  const auto last = std::find_if(given_.rbegin(), given_.rend(), [&](const Parameter& p) { return p.name == **twice; });
  fail(*last, "found parameter \"" + last->name + "\" of " + directive_ + " a second time, expected it once");
}

void Parameters::fail(const Parameter& parameter, const std::string& message) const { throw SceneError(parameter.where, message); }

const Parameter* Parameters::lookup(const std::string& name) const {
  for (const Parameter& p : given_)
    if (p.name == name) return &p;
  if (defaults_)
    for (auto p = defaults_->rbegin(); p != defaults_->rend(); ++p)
      if (p->name == name) return &*p;
  return nullptr;
}

const Parameter* Parameters::find(const std::string& name, std::initializer_list<const char*> types) {
  if (std::find(known_.begin(), known_.end(), name) == known_.end()) known_.push_back(name);
  const auto untyped = std::find_if(given_.begin(), given_.end(), [&](const Parameter& p) { return p.name == name && p.type.empty(); });
  if (untyped != given_.end()) {
    std::vector<std::string> candidates(types.begin(), types.end());
    // A word is a texture where one has that name, and else the name of a spectrum.
    if (!untyped->strings.empty() && !context_.float_textures.contains(untyped->strings[0]) &&
        !context_.rgb_textures.contains(untyped->strings[0]))
      std::stable_partition(candidates.begin(), candidates.end(), [](const std::string& type) { return type != "texture"; });
    if (!untyped->strings.empty() &&
        (context_.float_textures.contains(untyped->strings[0]) || context_.rgb_textures.contains(untyped->strings[0])))
      std::stable_partition(candidates.begin(), candidates.end(), [](const std::string& type) { return type == "texture"; });
    if (!adopt_type(*untyped, candidates))
      fail(*untyped, "found a value that does not fit \"" + name + "\" of " + directive_ + ", expected one of type " + joined(types));
  }
  const Parameter* parameter = lookup(name);
  if (!parameter) return nullptr;
  if (std::none_of(types.begin(), types.end(), [&](const char* type) { return parameter->type == type; }))
    fail(*parameter, "found \"" + parameter->type + " " + name + "\" for " + directive_ + ", expected type " + joined(types));
  return parameter;
}

bool Parameters::has(const std::string& name) { return lookup(name) != nullptr; }

SourceLocation Parameters::place(const std::string& name) const {
  const Parameter* parameter = lookup(name);
  return parameter ? parameter->where : where_;
}

void Parameters::expect_count(const Parameter& parameter, size_t count) const {
  const size_t found = parameter.numbers.size() + parameter.strings.size();
  if (found != count)
    fail(parameter, "found " + std::to_string(found) + " values for \"" + parameter.type + " " + parameter.name + "\" of " + directive_ +
                        ", expected " + std::to_string(count));
}

double Parameters::number(const std::string& name, double otherwise) {
  const Parameter* p = find(name, {"float"});
  if (!p) return otherwise;
  expect_count(*p, 1);
  return p->numbers[0];
}

float Parameters::real(const std::string& name, float otherwise) {
  const double value = number(name, otherwise);
  if (!fits_float(value)) throw SceneError(place(name), "found a value too large for \"float " + name + "\" of " + directive_);
  return static_cast<float>(value);
}

double Parameters::number_within(const std::string& name, double otherwise, double lowest, double highest) {
  const double value = number(name, otherwise);
  if (!(value >= lowest && value <= highest))
    throw SceneError(place(name), "found " + name + " = " + std::to_string(value) + " for " + directive_ + ", expected a value from " +
                                      std::to_string(lowest) + " to " + std::to_string(highest));
  return value;
}

int Parameters::integer(const std::string& name, int otherwise, int lowest, int highest) {
  const Parameter* p = find(name, {"integer"});
  if (!p) return otherwise;
  expect_count(*p, 1);
  const double value = p->numbers[0];
  if (!(value >= lowest && value <= highest))
    fail(*p, "found " + name + " = " + std::to_string(static_cast<int64_t>(value)) + " for " + directive_ + ", expected a value from " +
                 std::to_string(lowest) + " to " + std::to_string(highest));
  return static_cast<int>(value);
}

bool Parameters::boolean(const std::string& name, bool otherwise) {
  const Parameter* p = find(name, {"bool"});
  if (!p) return otherwise;
  expect_count(*p, 1);
  return p->strings[0] == "true";
}

std::string Parameters::string(const std::string& name, const std::string& otherwise) {
  const Parameter* p = find(name, {"string"});
  if (!p) return otherwise;
  expect_count(*p, 1);
  return p->strings[0];
}

std::string Parameters::choice(const std::string& name, const std::string& otherwise, const std::vector<std::string>& choices) {
  const std::string value = string(name, otherwise);
  if (std::find(choices.begin(), choices.end(), value) == choices.end())
    throw SceneError(place(name), "found \"" + value + "\" for \"string " + name + "\" of " + directive_ + ", expected one of " +
                                      quoted_list(choices) + "." + suggestion(value, choices));
  return value;
}

std::filesystem::path Parameters::file(const std::string& name) {
  const Parameter* p = find(name, {"string"});
  if (!p) return {};
  expect_count(*p, 1);
  return context_.files.resolve(p->strings[0], p->folder, p->where);
}

std::vector<double> Parameters::tuples(const std::string& name, std::initializer_list<const char*> types, size_t size) {
  const Parameter* p = find(name, types);
  if (!p) return {};
  if (p->numbers.size() % size != 0)
    fail(*p, "found " + std::to_string(p->numbers.size()) + " values for \"" + p->type + " " + name + "\" of " + directive_ +
                 ", expected a multiple of " + std::to_string(size));
  return p->numbers;
}

std::vector<double> Parameters::numbers(const std::string& name, std::optional<size_t> count) {
  const Parameter* p = find(name, {"float"});
  if (!p) return {};
  if (count) expect_count(*p, *count);
  return p->numbers;
}

std::vector<int> Parameters::integers(const std::string& name, std::optional<size_t> count) {
  const Parameter* p = find(name, {"integer"});
  if (!p) return {};
  if (count) expect_count(*p, *count);
  std::vector<int> values;
  values.reserve(p->numbers.size());
  for (const double v : p->numbers) values.push_back(static_cast<int>(v));
  return values;
}

std::vector<std::string> Parameters::strings(const std::string& name, std::optional<size_t> count) {
  const Parameter* p = find(name, {"string"});
  if (!p) return {};
  if (count) expect_count(*p, *count);
  return p->strings;
}

std::vector<DVec3> Parameters::points(const std::string& name) {
  const std::vector<double> v = tuples(name, {"point3"}, 3);
  std::vector<DVec3> points(v.size() / 3);
  for (size_t i = 0; i < points.size(); ++i) points[i] = {v[3 * i], v[3 * i + 1], v[3 * i + 2]};
  return points;
}

std::vector<DVec2> Parameters::points2(const std::string& name) {
  const std::vector<double> v = tuples(name, {"point2"}, 2);
  std::vector<DVec2> points(v.size() / 2);
  for (size_t i = 0; i < points.size(); ++i) points[i] = {v[2 * i], v[2 * i + 1]};
  return points;
}

std::vector<Vec3> Parameters::normals(const std::string& name) {
  const std::vector<double> v = tuples(name, {"normal"}, 3);
  std::vector<Vec3> normals(v.size() / 3);
  for (size_t i = 0; i < normals.size(); ++i) normals[i] = Vec3(DVec3(v[3 * i], v[3 * i + 1], v[3 * i + 2]));
  return normals;
}

std::vector<Rgb> Parameters::colors(const std::string& name) {
  const std::vector<double> v = tuples(name, {"rgb"}, 3);
  std::vector<Rgb> colors(v.size() / 3);
  for (size_t i = 0; i < colors.size(); ++i) colors[i] = Rgb(DVec3(v[3 * i], v[3 * i + 1], v[3 * i + 2]));
  return colors;
}

DVec3 Parameters::point(const std::string& name, DVec3 otherwise) {
  const Parameter* p = find(name, {"point3"});
  if (!p) return otherwise;
  expect_count(*p, 3);
  return {p->numbers[0], p->numbers[1], p->numbers[2]};
}

DVec3 Parameters::vector(const std::string& name, DVec3 otherwise) {
  const Parameter* p = find(name, {"vector3"});
  if (!p) return otherwise;
  expect_count(*p, 3);
  return {p->numbers[0], p->numbers[1], p->numbers[2]};
}

SampledSpectrum Parameters::sampled_spectrum(const Parameter& parameter) {
  std::vector<double> values = parameter.numbers;
  if (!parameter.strings.empty()) {
    const std::filesystem::path file = context_.files.resolve(parameter.strings[0], parameter.folder, parameter.where);
    const std::string text = context_.files.read_unpacked(file, uint64_t{1} << 26, parameter.where);
    Lexer lexer(text, context_.files.display_name(file));
    for (Token token = lexer.next(); token.kind != Token::Kind::kEnd; token = lexer.next()) {
      double value = 0;
      if (token.kind != Token::Kind::kWord || !parse_number(token.text, value))
        throw SceneError(lexer.location(token), "found \"" + std::string(token.text.substr(0, 40)) +
                                                    "\" in a spectrum file, expected pairs of wavelength and value");
      values.push_back(value);
    }
  }
  if (values.empty() || values.size() % 2 != 0)
    fail(parameter, "found " + std::to_string(values.size()) + " values for \"spectrum " + parameter.name + "\" of " + directive_ +
                        ", expected pairs of wavelength (nm) and value, a file or one of " + quoted_list(named_spectra()));
  SampledSpectrum spectrum;
  for (size_t i = 0; i < values.size(); i += 2) {
    if (!spectrum.empty() && values[i] <= spectrum.back().first)
      fail(parameter, "found wavelength " + std::to_string(values[i]) + " after " + std::to_string(spectrum.back().first) +
                          " in \"spectrum " + parameter.name + "\", expected rising wavelengths");
    if (!(values[i + 1] >= 0 && fits_float(values[i + 1])))
      fail(parameter, "found the value " + std::to_string(values[i + 1]) + " in \"spectrum " + parameter.name + "\" of " + directive_ +
                          ", expected values of at least 0");
    spectrum.emplace_back(values[i], values[i + 1]);
  }
  return spectrum;
}

Rgb Parameters::color_value(const Parameter& parameter, SpectrumUse use) {
  Rgb value(0);
  if (parameter.type == "rgb") {
    expect_count(parameter, 3);
    for (int c = 0; c < 3; ++c) {
      if (!(parameter.numbers[c] >= 0 && fits_float(parameter.numbers[c])))
        fail(parameter, "found " + std::to_string(parameter.numbers[c]) + " in \"rgb " + parameter.name + "\" of " + directive_ +
                            ", expected values of at least 0");
      value[c] = static_cast<float>(parameter.numbers[c]);
    }
  } else if (parameter.type == "blackbody") {
    expect_count(parameter, 1);
    const double kelvin = parameter.numbers[0];
    if (!(kelvin > 0 && kelvin <= 1e6))
      fail(parameter, "found a temperature of " + std::to_string(kelvin) + " K for \"blackbody " + parameter.name +
                          "\", expected more than 0 and at most 1e6");
    if (use == SpectrumUse::kIlluminant) return blackbody_rgb(static_cast<float>(kelvin));
    SampledSpectrum spectrum;
    for (int lambda = 380; lambda <= 780; lambda += 5) spectrum.emplace_back(lambda, normalized_planck(lambda, kelvin));
    value = project(spectrum, use);
  } else {
    if (parameter.numbers.empty()) expect_count(parameter, 1);
    if (!parameter.strings.empty()) {
      const std::string& name = parameter.strings[0];
      if (const auto coefficient = named_coefficient(name)) return *coefficient;
      if (const auto glass = named_glass(name)) return Rgb(*glass);
      if (const auto illuminant = named_illuminant(name)) return *illuminant;
    }
    value = project(sampled_spectrum(parameter), use);
  }
  if (use != SpectrumUse::kReflectance || !(max_component(value) > 1)) return value;
  // As pbrt-v4 refuses it. The projection of a spectrum may lie outside of what RGB can say, though the spectrum is possible.
  if (parameter.type == "rgb")
    fail(parameter,
         "found \"" + parameter.type + " " + parameter.name + "\" of " + directive_ + " above 1, expected a reflectance from 0 to 1");
  context_.warn(parameter.where, "\"" + parameter.type + " " + parameter.name + "\" of " + directive_ + " reaches " +
                                     std::to_string(max_component(value)) + " as RGB; what is above 1 is cut to 1");
  return glm::min(value, Rgb(1));
}

std::optional<Rgb> Parameters::color(const std::string& name, SpectrumUse use) {
  const Parameter* p = find(name, {"rgb", "spectrum", "blackbody"});
  if (!p) return std::nullopt;
  return color_value(*p, use);
}

std::optional<FloatParameter> Parameters::optional_float_or_texture(const std::string& name) {
  const Parameter* p = find(name, {"float", "texture"});
  if (!p) return std::nullopt;
  expect_count(*p, 1);
  if (p->type == "texture") {
    const auto found = context_.float_textures.find(p->strings[0]);
    if (found == context_.float_textures.end()) {
      std::vector<std::string> names;
      for (const auto& [known, index] : context_.float_textures) names.push_back(known);
      fail(*p, "found the unknown float texture \"" + p->strings[0] + "\", expected one of: " + quoted_list(names) + "." +
                   suggestion(p->strings[0], names) + " Declare it with Texture \"" + p->strings[0] + "\" \"float\" … first");
    }
    return FloatParameter{0, found->second};
  }
  if (!fits_float(p->numbers[0])) fail(*p, "found a value too large for \"float " + name + "\" of " + directive_);
  return FloatParameter{static_cast<float>(p->numbers[0]), kNone};
}

FloatParameter Parameters::float_or_texture(const std::string& name, float otherwise) {
  return optional_float_or_texture(name).value_or(FloatParameter{otherwise, kNone});
}

std::optional<RgbParameter> Parameters::optional_color_or_texture(const std::string& name, SpectrumUse use) {
  const Parameter* p = find(name, {"rgb", "spectrum", "blackbody", "texture"});
  if (!p) return std::nullopt;
  if (p->type != "texture") return RgbParameter{color_value(*p, use), kNone};
  expect_count(*p, 1);
  const auto found = context_.rgb_textures.find(p->strings[0]);
  if (found == context_.rgb_textures.end()) {
    std::vector<std::string> names;
    for (const auto& [known, index] : context_.rgb_textures) names.push_back(known);
    fail(*p, "found the unknown spectrum texture \"" + p->strings[0] + "\", expected one of: " + quoted_list(names) + "." +
                 suggestion(p->strings[0], names) + " Declare it with Texture \"" + p->strings[0] + "\" \"spectrum\" … first");
  }
  return RgbParameter{Rgb(0), found->second};
}

RgbParameter Parameters::color_or_texture(const std::string& name, Rgb otherwise, SpectrumUse use) {
  return optional_color_or_texture(name, use).value_or(RgbParameter{otherwise, kNone});
}

float Parameters::refraction_index(const std::string& name, float otherwise) {
  const Parameter* p = find(name, {"float", "spectrum", "rgb", "texture"});
  if (!p) return otherwise;
  double value = otherwise;
  if (p->type == "texture") {
    context_.unsupported(p->where, "a texture for the index of refraction \"" + name + "\" of " + directive_);
  } else if (p->type == "float") {
    expect_count(*p, 1);
    value = p->numbers[0];
  } else if (p->type == "rgb") {
    const Rgb rgb = color_value(*p, SpectrumUse::kUnbounded);
    if (rgb.r != rgb.g || rgb.g != rgb.b)
      context_.warn(p->where, "dispersion is not simulated: the green channel of \"" + name + "\" is used for all");
    value = rgb.g;
  } else {
    constexpr double kFraunhoferD = 587.6;
    const auto glass = p->strings.empty() ? std::nullopt : named_glass(p->strings[0]);
    if (!glass && !p->strings.empty() && (named_coefficient(p->strings[0]) || named_illuminant(p->strings[0])))
      fail(*p, "found \"" + p->strings[0] + "\" as the index of refraction of " + directive_ +
                   ", expected a number or a glass such as \"glass-BK7\"");
    value = glass ? *glass : evaluate(sampled_spectrum(*p), kFraunhoferD);
    context_.warn(p->where, "dispersion is not simulated: \"" + name + "\" is taken at 587.6 nm");
  }
  if (!(value > 0 && value < 100))
    fail(*p, "found the index of refraction " + std::to_string(value) + " for " + directive_ + ", expected more than 0 and below 100");
  return static_cast<float>(value);
}

void Parameters::refuse(const std::string& name, bool changes_picture, const std::string& advice) {
  if (std::find(known_.begin(), known_.end(), name) == known_.end()) known_.push_back(name);
  const Parameter* p = lookup(name);
  if (!p) return;
  const std::string what = "parameter \"" + p->type + " " + name + "\" of " + directive_ + (advice.empty() ? "" : " (" + advice + ")");
  if (changes_picture)
    context_.unsupported(p->where, what);
  else
    context_.ignore(p->where, what);
}

void Parameters::finish() {
  for (const Parameter& p : given_) {
    if (std::find(known_.begin(), known_.end(), p.name) != known_.end()) continue;
    const std::string expected = known_.empty() ? "none" : "one of " + quoted_list(known_);
    fail(p, "found the unknown parameter \"" + p.type + (p.type.empty() ? "" : " ") + p.name + "\" of " + directive_ + ", expected " +
                expected + "." + suggestion(p.name, known_) + " Correct or remove it");
  }
}

}  // namespace woodcock
