#include "renderer/scene/parameter_edits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "renderer/scene/lexer.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

[[noreturn]] void refuse(std::string_view text, const std::string& expected) {
  throw std::invalid_argument(fmt::format("set: found \"{}\", expected {}", text.substr(0, 200), expected));
}

/// What a directive is called in paths; `named` ones by their argument, `counted` ones by their place.
struct Kind {
  const char* directive;
  const char* name;
  enum { kOnly, kNamed, kCounted } identity;
};
constexpr Kind kKinds[] = {{"Camera", "camera", Kind::kOnly},
                           {"Film", "film", Kind::kOnly},
                           {"PixelFilter", "filter", Kind::kOnly},
                           {"Sampler", "sampler", Kind::kOnly},
                           {"Integrator", "integrator", Kind::kOnly},
                           {"MakeNamedMedium", "medium", Kind::kNamed},
                           {"MakeNamedMaterial", "material", Kind::kNamed},
                           {"Texture", "texture", Kind::kNamed},
                           {"Material", "material", Kind::kCounted},
                           {"LightSource", "light", Kind::kCounted},
                           {"AreaLightSource", "arealight", Kind::kCounted},
                           {"Shape", "shape", Kind::kCounted}};

std::string kind_names() {
  std::set<std::string> names;
  for (const Kind& kind : kKinds) names.insert(kind.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

std::vector<std::string> words_of(std::string_view text) {
  std::vector<std::string> words;
  for (size_t at = 0; at < text.size();) {
    const size_t begin = text.find_first_not_of(" \t", at);
    if (begin == std::string_view::npos) break;
    const size_t end = std::min(text.find_first_of(" \t", begin), text.size());
    words.emplace_back(text.substr(begin, end - begin));
    at = end;
  }
  return words;
}

bool is_whole(double v) { return v == std::floor(v) && std::abs(v) <= 2147483647.0; }

bool fits(const Parameter& value, const std::string& type) {
  const size_t n = value.numbers.size();
  if (type == "bool") return value.strings.size() == 1 && (value.strings[0] == "true" || value.strings[0] == "false");
  if (type == "string" || type == "texture") return value.strings.size() == 1;
  if (type == "spectrum") return value.strings.size() == 1 || (n > 3 && n % 2 == 0);
  if (type == "float") return n >= 1;
  if (type == "blackbody") return n == 1;
  if (type == "integer") return n >= 1 && std::all_of(value.numbers.begin(), value.numbers.end(), is_whole);
  if (type == "rgb") return n == 1 || n == 3;
  if (type == "point2" || type == "vector2") return n >= 2 && n % 2 == 0;
  return n >= 3 && n % 3 == 0;
}

/// What parameter list the edit is for, and whether it names one by place.
std::string shown(const std::string& kind, int count) {
  return count == 1 ? kind + ".0" : fmt::format("{}.0 to {}.{}", kind, kind, count - 1);
}

}  // namespace

std::string ParameterEdit::text() const {
  const auto numbers = fmt::format("{}", fmt::join(value.numbers, " ")), strings = fmt::format("{}", fmt::join(value.strings, " "));
  return fmt::format("{}.{}={}{}", object, parameter, numbers, strings);
}

ParameterEdit parse_edit(std::string_view text) {
  const size_t equals = text.find('=');
  const std::string_view path = text.substr(0, equals);
  const size_t dot = path.rfind('.');
  if (equals == std::string_view::npos || dot == std::string_view::npos || dot == 0 || dot + 1 == path.size())
    refuse(text, "OBJECT.PARAMETER=VALUE, e.g. medium.smoke.g=0.8 or integrator.maxdepth=8");
  if (std::any_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f || c == ';'; }))
    refuse(text, "text without control characters and semicolons");
  ParameterEdit edit{std::string(path.substr(0, dot)), std::string(path.substr(dot + 1)), {}};
  const std::string kind = edit.object.substr(0, edit.object.find('.'));
  if (std::none_of(std::begin(kKinds), std::end(kKinds), [&](const Kind& k) { return kind == k.name; }))
    refuse(text, "a path that begins with one of " + kind_names());
  const std::vector<std::string> words = words_of(text.substr(equals + 1));
  if (words.empty()) refuse(text, "a value behind the equals sign");
  edit.value.name = edit.parameter;
  edit.value.where = {fmt::format("--set {}.{}", edit.object, edit.parameter), 0, 0};
  for (const std::string& word : words) {
    double number = 0;
    if (parse_number(word, number))
      edit.value.numbers.push_back(number);
    else
      edit.value.strings.push_back(word);
  }
  if (!edit.value.strings.empty() && words.size() != 1) refuse(text, "numbers, or one word");
  return edit;
}

ParameterEdits::ParameterEdits(const std::vector<std::string>& texts) {
  std::set<std::string> paths;
  size_t bytes = 0;
  for (const std::string& text : texts) {
    const ParameterEdit edit = parse_edit(text);
    if (!paths.insert(edit.object + '.' + edit.parameter).second) refuse(text, "each path once");
    bytes += edit.text().size() + 2;
    edits_.push_back({edit, false});
  }
  if (edits_.size() > kMaxEdits || bytes > kMaxEditText)
    throw std::invalid_argument(
        fmt::format("set: found {} of {} bytes, expected at most {} of {} bytes", edits_.size(), bytes, kMaxEdits, kMaxEditText));
  std::sort(edits_.begin(), edits_.end(), [](const Pending& a, const Pending& b) { return a.edit.text() < b.edit.text(); });
}

void ParameterEdits::apply(const std::string& directive, const std::string& argument, const std::filesystem::path& folder,
                           ParameterList& list) {
  if (edits_.empty()) return;
  const auto kind = std::find_if(std::begin(kKinds), std::end(kKinds), [&](const Kind& k) { return directive == k.directive; });
  if (kind == std::end(kKinds)) return;
  std::string object = kind->name;
  if (kind->identity == Kind::kNamed) object += '.' + argument;
  if (kind->identity == Kind::kCounted) object += '.' + std::to_string(counted_[kind->name]++);
  if (kind->identity != Kind::kCounted && objects_.size() < 100) objects_.push_back(object);
  for (Pending& pending : edits_) {
    if (pending.edit.object != object) continue;
    pending.met = true;
    Parameter value = pending.edit.value;
    value.folder = folder;
    const auto there = std::find_if(list.begin(), list.end(), [&](const Parameter& p) { return p.name == value.name; });
    if (there == list.end()) {
      list.push_back(value);
      continue;
    }
    adopt_type(value, {there->type});
    *there = value;
  }
}

void ParameterEdits::finish() const {
  for (const Pending& pending : edits_) {
    if (pending.met) continue;
    std::vector<std::string> there = objects_;
    std::sort(there.begin(), there.end());
    there.erase(std::unique(there.begin(), there.end()), there.end());
    for (const auto& [kind, count] : counted_) there.push_back(shown(kind, count));
    throw SceneError(pending.edit.value.where,
                     fmt::format("found no \"{}\" in the scene, expected one of {}", pending.edit.object,
                                 there.empty() ? "none: it has nothing to set" : fmt::format("{}", fmt::join(there, ", "))));
  }
}

std::string ParameterEdits::text() const {
  std::string text;
  for (const Pending& pending : edits_) text += (text.empty() ? "" : "; ") + pending.edit.text();
  return text;
}

bool adopt_type(Parameter& value, const std::vector<std::string>& types) {
  const auto type = std::find_if(types.begin(), types.end(), [&](const std::string& t) { return fits(value, t); });
  if (type == types.end()) return false;
  value.type = *type;
  if (value.type == "rgb" && value.numbers.size() == 1) value.numbers.assign(3, value.numbers[0]);
  return true;
}

}  // namespace woodcock
