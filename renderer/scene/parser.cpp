#include "renderer/scene/parser.h"

#include <algorithm>
#include <functional>
#include <glm/gtc/matrix_transform.hpp>
#include <map>

#include "renderer/scene/limits.h"
#include "renderer/scene/parameter_edits.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

const std::vector<std::string>& directive_names() {
  static const std::vector<std::string> kNames{"Accelerator",
                                               "ActiveTransform",
                                               "AreaLightSource",
                                               "Attribute",
                                               "AttributeBegin",
                                               "AttributeEnd",
                                               "Camera",
                                               "ColorSpace",
                                               "ConcatTransform",
                                               "CoordSysTransform",
                                               "CoordinateSystem",
                                               "Film",
                                               "Identity",
                                               "Import",
                                               "Include",
                                               "Integrator",
                                               "LightSource",
                                               "LookAt",
                                               "MakeNamedMaterial",
                                               "MakeNamedMedium",
                                               "Material",
                                               "MediumInterface",
                                               "NamedMaterial",
                                               "ObjectBegin",
                                               "ObjectEnd",
                                               "ObjectInstance",
                                               "Option",
                                               "PixelFilter",
                                               "ReverseOrientation",
                                               "Rotate",
                                               "Sampler",
                                               "Scale",
                                               "Shape",
                                               "Texture",
                                               "Transform",
                                               "TransformBegin",
                                               "TransformEnd",
                                               "TransformTimes",
                                               "Translate",
                                               "WorldBegin"};
  return kNames;
}

std::string shown(const Token& token) {
  switch (token.kind) {
    case Token::Kind::kEnd:
      return "the end of the file";
    case Token::Kind::kString:
      return "the string \"" + std::string(token.text.substr(0, 60)) + "\"";
    default:
      return "\"" + std::string(token.text.substr(0, 60)) + "\"";
  }
}

}  // namespace

Token Parser::next(Source& source) {
  const Token token = source.lexer.next();
  if (++tokens_ > limits::kTokens)
    throw SceneError(source.lexer.location(token), "found more than " + std::to_string(limits::kTokens) +
                                                       " tokens in the scene and the files it includes, which is more than is accepted");
  return token;
}

void Parser::parse(std::string_view text, const std::string& file_name, const std::filesystem::path& folder) {
  Lexer lexer(text, file_name);
  Source source{lexer, folder};
  while (true) {
    const Token token = next(source);
    if (token.kind == Token::Kind::kEnd) return;
    const SourceLocation where = lexer.location(token);
    if (token.kind != Token::Kind::kWord)
      throw SceneError(where, "found " + shown(token) + ", expected a directive such as Shape or Material");
    directive(source, std::string(token.text), where);
  }
}

std::string Parser::string_argument(Source& source, const std::string& word, const std::string& meaning) {
  const Token token = next(source);
  if (token.kind != Token::Kind::kString)
    throw SceneError(source.lexer.location(token), "found " + shown(token) + " after " + word + ", expected " + meaning + " in quotes");
  return std::string(token.text);
}

std::vector<double> Parser::numbers(Source& source, const std::string& word, size_t count, bool brackets) {
  std::vector<double> values;
  Token token = next(source);
  const bool bracketed = brackets && token.kind == Token::Kind::kOpen;
  if (bracketed) token = next(source);
  while (true) {
    double value = 0;
    if (token.kind != Token::Kind::kWord || !parse_number(token.text, value))
      throw SceneError(source.lexer.location(token),
                       "found " + shown(token) + " after " + word + ", expected " + std::to_string(count) + " numbers");
    values.push_back(value);
    if (values.size() == count) break;
    token = next(source);
  }
  if (bracketed) {
    token = next(source);
    if (token.kind != Token::Kind::kClose)
      throw SceneError(source.lexer.location(token),
                       "found " + shown(token) + ", expected \"]\" after " + std::to_string(count) + " numbers of " + word);
  }
  return values;
}

void Parser::add_value(Source& source, const Token& token, Parameter& parameter) {
  const auto fail = [&](const std::string& expected) {
    throw SceneError(source.lexer.location(token),
                     "found " + shown(token) + " as a value of \"" + parameter.type + " " + parameter.name + "\", expected " + expected);
  };
  if (token.kind == Token::Kind::kEnd || token.kind == Token::Kind::kOpen || token.kind == Token::Kind::kClose) fail("a value");
  if (parameter.type == "bool") {
    if (token.text != "true" && token.text != "false") fail("true or false");
    parameter.strings.emplace_back(token.text);
  } else if (parameter.type == "string" || parameter.type == "texture" ||
             (parameter.type == "spectrum" && token.kind == Token::Kind::kString)) {
    if (token.kind != Token::Kind::kString) fail("a string in quotes");
    if (parameter.type == "spectrum" && (!parameter.numbers.empty() || !parameter.strings.empty()))
      fail("either one name or pairs of wavelength and value");
    parameter.strings.emplace_back(token.text);
  } else if (parameter.type == "integer") {
    int64_t value = 0;
    if (token.kind != Token::Kind::kWord || !parse_integer(token.text, value) || value < -2147483648LL || value > 2147483647LL)
      fail("a whole number of 32 bits");
    parameter.numbers.push_back(static_cast<double>(value));
  } else {
    double value = 0;
    if (token.kind != Token::Kind::kWord || !parse_number(token.text, value)) fail("a finite number");
    if (parameter.type == "spectrum" && !parameter.strings.empty()) fail("nothing after the name of a spectrum");
    parameter.numbers.push_back(value);
  }
}

Parameter Parser::parameter(Source& source, const Token& declaration) {
  Parameter parameter;
  parameter.where = source.lexer.location(declaration);
  parameter.folder = source.folder;
  const std::string_view text = declaration.text;
  const size_t type_begin = text.find_first_not_of(" \t");
  const size_t type_end = type_begin == std::string_view::npos ? type_begin : text.find_first_of(" \t", type_begin);
  const size_t name_begin = type_end == std::string_view::npos ? type_end : text.find_first_not_of(" \t", type_end);
  if (name_begin == std::string_view::npos)
    throw SceneError(parameter.where,
                     "found the string \"" + std::string(text.substr(0, 60)) + "\", expected a parameter as \"type name\"");
  const size_t name_end = std::min(text.find_first_of(" \t", name_begin), text.size());
  const std::string type(text.substr(type_begin, type_end - type_begin));
  parameter.name = text.substr(name_begin, name_end - name_begin);
  if (text.find_first_not_of(" \t", name_end) != std::string_view::npos)
    throw SceneError(parameter.where,
                     "found \"" + std::string(text.substr(0, 60)) + "\", expected a parameter as \"type name\" without more words");
  parameter.type = canonical_type(type);
  if (parameter.type.empty())
    throw SceneError(parameter.where,
                     "found the parameter type \"" + type + "\" of \"" + parameter.name + "\", expected one of " +
                         quoted_list(parameter_types()) + "." +
                         (type == "color" ? " Write \"rgb\" for the \"color\" of old files" : suggestion(type, parameter_types())));
  Token token = next(source);
  if (token.kind != Token::Kind::kOpen) {
    add_value(source, token, parameter);
    return parameter;
  }
  while ((token = next(source)).kind != Token::Kind::kClose) add_value(source, token, parameter);
  return parameter;
}

ParameterList Parser::parameters(Source& source) {
  ParameterList list;
  while (true) {
    const Token token = next(source);
    if (token.kind != Token::Kind::kString) {
      source.lexer.unget(token);
      return list;
    }
    list.push_back(parameter(source, token));
  }
}

void Parser::include(Source& source, const std::string& word, const SourceLocation& where) {
  const std::string name = string_argument(source, word, "a file name");
  const std::filesystem::path file = context_.files.resolve(name, source.folder, where);
  if (std::find(open_files_.begin(), open_files_.end(), file) != open_files_.end())
    throw SceneError(where, "found " + word + " of \"" + name + "\", which is being read already: files that include each other never end");
  if (open_files_.size() >= static_cast<size_t>(limits::kIncludeDepth))
    throw SceneError(where,
                     "found files included more than " + std::to_string(limits::kIncludeDepth) + " deep, which is more than is accepted");
  if (++includes_ > limits::kIncludes)
    throw SceneError(where, "found more than " + std::to_string(limits::kIncludes) + " includes, which is more than is accepted");
  const std::string text = context_.files.read_unpacked(file, limits::kTextBytes, where);
  open_files_.push_back(file);
  if (word == "Import") builder_.import_begin(where);
  parse(text, context_.files.display_name(file), file.parent_path());
  if (word == "Import") builder_.import_end(where);
  open_files_.pop_back();
}

bool Parser::transform_directive(Source& source, const std::string& word, const SourceLocation& where) {
  if (word == "Identity") {
    builder_.identity();
  } else if (word == "Translate") {
    const auto v = numbers(source, word, 3, false);
    builder_.multiply(glm::translate(DMat4(1), DVec3(v[0], v[1], v[2])), where);
  } else if (word == "Scale") {
    const auto v = numbers(source, word, 3, false);
    builder_.multiply(glm::scale(DMat4(1), DVec3(v[0], v[1], v[2])), where);
  } else if (word == "Rotate") {
    const auto v = numbers(source, word, 4, false);
    const DVec3 axis(v[1], v[2], v[3]);
    if (!(glm::length(axis) > 0)) throw SceneError(where, "found Rotate about the axis 0 0 0, expected an axis with a direction");
    builder_.multiply(glm::rotate(DMat4(1), glm::radians(v[0]), axis), where);
  } else if (word == "LookAt") {
    const auto v = numbers(source, word, 9, false);
    const DVec3 eye(v[0], v[1], v[2]), look(v[3], v[4], v[5]), up(v[6], v[7], v[8]);
    const DVec3 ahead = look - eye;
    const DVec3 side = glm::cross(up, ahead);
    if (!(glm::length(side) > 1e-12 * glm::length(up) * glm::length(ahead)))
      throw SceneError(where, "found LookAt whose up vector is parallel to the viewing direction (or zero), expected another one");
    // Left-handed, as pbrt-v4: x right, y up, z ahead.
    const DVec3 z = glm::normalize(ahead), x = glm::normalize(side), y = glm::cross(z, x);
    const DMat4 world_from_camera(glm::dvec4(x, 0), glm::dvec4(y, 0), glm::dvec4(z, 0), glm::dvec4(eye, 1));
    // Rigid, so the inverse is exact up to rounding: transpose and moved eye.
    const glm::dmat3 rotation = glm::transpose(glm::dmat3(world_from_camera));
    DMat4 camera_from_world(rotation);
    camera_from_world[3] = glm::dvec4(-(rotation * eye), 1);
    builder_.multiply(camera_from_world, where);
  } else if (word == "Transform" || word == "ConcatTransform") {
    const auto v = numbers(source, word, 16, true);
    DMat4 matrix;
    for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = v[static_cast<size_t>(i)];
    word == "Transform" ? builder_.set_transform(matrix, where) : builder_.multiply(matrix, where);
  } else if (word == "CoordinateSystem") {
    builder_.coordinate_system(string_argument(source, word, "a name"));
  } else if (word == "CoordSysTransform") {
    builder_.coord_sys_transform(string_argument(source, word, "a name"), where);
  } else if (word == "ActiveTransform") {
    const Token token = next(source);
    if (token.kind != Token::Kind::kWord)
      throw SceneError(source.lexer.location(token),
                       "found " + shown(token) + " after ActiveTransform, expected StartTime, EndTime or All");
    builder_.active_transform(std::string(token.text), where);
  } else if (word == "TransformTimes") {
    const auto v = numbers(source, word, 2, false);
    builder_.transform_times(v[0], v[1]);
  } else {
    return false;
  }
  return true;
}

bool Parser::block_directive(Source& source, const std::string& word, const SourceLocation& where) {
  if (word == "TransformBegin" || word == "TransformEnd") {
    // As in pbrt-v4, which kept the words of old files and lets them save everything.
    context_.warn(where, word + " is deprecated and acts as Attribute" + word.substr(9));
    word == "TransformBegin" ? builder_.attribute_begin("AttributeBegin", where) : builder_.attribute_end("AttributeEnd", where);
  } else if (word == "AttributeBegin") {
    builder_.attribute_begin(word, where);
  } else if (word == "AttributeEnd") {
    builder_.attribute_end(word, where);
  } else if (word == "ObjectBegin") {
    builder_.object_begin(string_argument(source, word, "a name"), where);
  } else if (word == "ObjectEnd") {
    builder_.object_end(where);
  } else if (word == "ObjectInstance") {
    builder_.object_instance(string_argument(source, word, "a name"), where);
  } else if (word == "WorldBegin") {
    builder_.world_begin(where);
  } else if (word == "ReverseOrientation") {
    builder_.reverse_orientation(where);
  } else if (word == "ColorSpace") {
    builder_.color_space(string_argument(source, word, "a colour space"), where);
  } else if (word == "NamedMaterial") {
    builder_.named_material(string_argument(source, word, "a name"), where);
  } else if (word == "MediumInterface") {
    const std::string inside = string_argument(source, word, "the medium inside");
    const Token token = source.lexer.next();
    const bool two = token.kind == Token::Kind::kString;
    // One name stands for both sides.
    const std::string outside = two ? std::string(token.text) : inside;
    if (!two) source.lexer.unget(token);
    builder_.medium_interface(inside, outside, where);
  } else if (word == "Option") {
    builder_.option(parameters(source), where);
  } else if (word == "Include" || word == "Import") {
    include(source, word, where);
  } else {
    return false;
  }
  return true;
}

bool Parser::named_directive(Source& source, const std::string& word, const SourceLocation& where) {
  using Method = void (SceneBuilder::*)(const std::string&, ParameterList, const SourceLocation&);
  static const std::map<std::string, Method> kMethods{{"Accelerator", &SceneBuilder::accelerator},
                                                      {"AreaLightSource", &SceneBuilder::area_light_source},
                                                      {"Attribute", &SceneBuilder::attribute},
                                                      {"Camera", &SceneBuilder::camera},
                                                      {"Film", &SceneBuilder::film},
                                                      {"Integrator", &SceneBuilder::integrator},
                                                      {"LightSource", &SceneBuilder::light_source},
                                                      {"MakeNamedMaterial", &SceneBuilder::make_named_material},
                                                      {"MakeNamedMedium", &SceneBuilder::make_named_medium},
                                                      {"Material", &SceneBuilder::material},
                                                      {"PixelFilter", &SceneBuilder::pixel_filter},
                                                      {"Sampler", &SceneBuilder::sampler},
                                                      {"Shape", &SceneBuilder::shape}};
  const auto method = kMethods.find(word);
  if (method != kMethods.end()) {
    const std::string name = string_argument(source, word, "a type or name");
    ParameterList list = parameters(source);
    context_.edits.apply(word, name, source.folder, list);
    (builder_.*method->second)(name, std::move(list), where);
    return true;
  }
  if (word == "Texture") {
    const std::string name = string_argument(source, word, "a name");
    const std::string type = string_argument(source, word, "\"float\" or \"spectrum\"");
    const std::string kind = string_argument(source, word, "a type such as \"imagemap\"");
    ParameterList list = parameters(source);
    context_.edits.apply(word, name, source.folder, list);
    builder_.texture(name, type, kind, std::move(list), where);
    return true;
  }
  return false;
}

void Parser::directive(Source& source, const std::string& word, const SourceLocation& where) {
  if (transform_directive(source, word, where) || block_directive(source, word, where) || named_directive(source, word, where)) return;
  if (word == "WorldEnd")
    throw SceneError(where, "found WorldEnd of pbrt-v3, expected nothing in its place: pbrt-v4's world ends with the file");
  throw SceneError(where, "found the unknown directive \"" + word.substr(0, 60) + "\", expected one of " + quoted_list(directive_names()) +
                              "." + suggestion(word, directive_names()));
}

}  // namespace woodcock
