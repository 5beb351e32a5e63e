#include "renderer/scene/ply.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <vector>

#include "renderer/scene/lexer.h"
#include "renderer/scene/scene_error.h"
#include "renderer/scene/text_file.h"

namespace woodcock {

namespace {

enum class Type { kInt8, kUint8, kInt16, kUint16, kInt32, kUint32, kFloat, kDouble };
constexpr size_t kBytes[] = {1, 1, 2, 2, 4, 4, 4, 8};
constexpr std::string_view kBlanks = " \t\r\n\f\v";

/// A number that is not finite, as printf writes it.
bool is_not_finite(std::string_view text) {
  std::string word(text);
  std::transform(word.begin(), word.end(), word.begin(), [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c; });
  if (word.starts_with('-') || word.starts_with('+')) word.erase(0, 1);
  // Windows writes -nan(ind), 1.#IND, 1.#QNAN and 1.#INF.
  return word.starts_with("nan") || word == "inf" || word == "infinity" || word.starts_with("1.#");
}

struct Property {
  std::string name;
  Type type = Type::kFloat;
  bool is_list = false;
  Type count_type = Type::kUint8;
};

struct Element {
  std::string name;
  uint64_t count = 0;
  std::vector<Property> properties;
};

/// Walks the bytes; every step is checked against the end.
class PlyReader {
 public:
  PlyReader(std::string_view bytes, const std::string& name, const SourceLocation& where) : bytes_(bytes), name_(name), where_(where) {}

  TriangleMesh read() {
    read_header();
    for (const Element& element : elements_) {
      check_count(element);
      if (element.name == "vertex")
        read_vertices(element);
      else if (element.name == "face")
        read_faces(element);
      else
        skip(element);
    }
    if (!seen_vertices_ || !seen_faces_)
      fail("found no " + std::string(seen_vertices_ ? "face" : "vertex") + " element, expected vertices and faces");
    clear_unused_vertices();
    return std::move(mesh_);
  }

  /// What was left out, one sentence for each cause.
  std::vector<std::string> warnings() const {
    std::vector<std::string> list;
    for (const auto& [corners, count] : left_out_)
      list.push_back("PLY file \"" + name_ + "\": " + std::to_string(count) + (count == 1 ? " face" : " faces") + " of " +
                     std::to_string(corners) + (corners == 1 ? " corner" : " corners") + (count == 1 ? " is left out" : " are left out") +
                     ", only triangles and quadrilaterals are read (as in pbrt-v4)");
    if (left_out_.size() > kShownCounts) {
      uint64_t count = 0;
      for (const auto& [corners, faces] : left_out_) count += faces;
      list = {"PLY file \"" + name_ + "\": " + std::to_string(count) + " faces of " + std::to_string(left_out_.begin()->first) + " to " +
              std::to_string(left_out_.rbegin()->first) +
              " corners are left out, only triangles and quadrilaterals are read (as in pbrt-v4)"};
    }
    if (!face_coordinates_.empty())
      list.push_back("PLY file \"" + name_ + "\": the texture coordinates of its faces (\"" + face_coordinates_ +
                     "\") are not read (as in pbrt-v4); those of vertices (u v or s t) are, else a triangle has the default ones");
    return list;
  }

 private:
  [[noreturn]] void fail(const std::string& message) const { throw SceneError(where_, "PLY file \"" + name_ + "\": " + message); }

  /// A line of the header. All lines end as the first one does: behind a CR there may be data that look like LF.
  std::string_view line() {
    if (line_end_.empty()) {
      const size_t end = bytes_.find_first_of("\r\n");
      line_end_ = end == std::string_view::npos || bytes_[end] == '\n' ? "\n" : bytes_.substr(end).starts_with("\r\n") ? "\r\n" : "\r";
    }
    size_t end = bytes_.find(line_end_, position_), length = line_end_.size();
    // Some writers end a few lines otherwise than the first.
    if (line_end_ != "\r") {
      end = bytes_.find('\n', position_);
      length = 1;
    }
    if (end == std::string_view::npos) fail("found the end of the file in the header, expected \"end_header\"");
    std::string_view text = bytes_.substr(position_, end - position_);
    position_ = end + length;
    if (!text.empty() && text.back() == '\r') text.remove_suffix(1);
    return text;
  }

  static std::vector<std::string> words(std::string_view text) {
    std::vector<std::string> list;
    size_t i = 0;
    while (i < text.size()) {
      const size_t begin = text.find_first_not_of(" \t", i);
      if (begin == std::string_view::npos) break;
      const size_t end = std::min(text.find_first_of(" \t", begin), text.size());
      list.emplace_back(text.substr(begin, end - begin));
      i = end;
    }
    return list;
  }

  Type type_named(const std::string& name) const {
    static const std::vector<std::pair<const char*, Type>> kNames{
        {"char", Type::kInt8},   {"int8", Type::kInt8},     {"uchar", Type::kUint8},   {"uint8", Type::kUint8},
        {"short", Type::kInt16}, {"int16", Type::kInt16},   {"ushort", Type::kUint16}, {"uint16", Type::kUint16},
        {"int", Type::kInt32},   {"int32", Type::kInt32},   {"uint", Type::kUint32},   {"uint32", Type::kUint32},
        {"float", Type::kFloat}, {"float32", Type::kFloat}, {"double", Type::kDouble}, {"float64", Type::kDouble}};
    for (const auto& [known, type] : kNames)
      if (name == known) return type;
    fail("found the property type \"" + name + "\", expected a number type such as float or int");
  }

  void read_header() {
    expect_utf8(bytes_, name_);
    if (line() != "ply") fail("found something else than \"ply\" in the first line: it is no PLY file");
    constexpr size_t kMaxHeaderLines = 1000;
    bool have_format = false;
    for (size_t n = 0; n < kMaxHeaderLines; ++n) {
      const std::vector<std::string> w = words(line());
      if (w.empty() || w[0] == "comment" || w[0] == "obj_info") continue;
      if (w[0] == "end_header") {
        if (!have_format) fail("found no format line in the header");
        return;
      }
      if (w[0] == "format" && w.size() == 3) {
        have_format = true;
        if (w[1] == "ascii")
          ascii_ = true;
        else if (w[1] == "binary_little_endian" || w[1] == "binary_big_endian")
          swap_ = (w[1] == "binary_big_endian") == (std::endian::native == std::endian::little);
        else
          fail("found the format \"" + w[1] + "\", expected ascii, binary_little_endian or binary_big_endian");
      } else if (w[0] == "element" && w.size() == 3) {
        int64_t count = 0;
        if (!parse_integer(w[2], count) || count < 0)
          fail("found \"" + w[2] + "\" as the count of element " + w[1] + ", expected a whole number");
        elements_.push_back({w[1], static_cast<uint64_t>(count), {}});
      } else if (w[0] == "property" && w.size() == 3 && !elements_.empty()) {
        elements_.back().properties.push_back({w[2], type_named(w[1]), false, Type::kUint8});
      } else if (w[0] == "property" && w.size() == 5 && w[1] == "list" && !elements_.empty()) {
        const Type count_type = type_named(w[2]);
        if (count_type == Type::kFloat || count_type == Type::kDouble)
          fail("found a list whose count is a " + w[2] + ", expected a whole number type");
        elements_.back().properties.push_back({w[4], type_named(w[3]), true, count_type});
      } else {
        fail("found the header line \"" + w[0] + " …\", expected format, comment, element, property or end_header");
      }
    }
    fail("found a header of more than " + std::to_string(kMaxHeaderLines) + " lines");
  }

  /// A header may claim anything; the bytes that follow bound what it can mean.
  void check_count(const Element& element) const {
    uint64_t smallest = 0;
    for (const Property& p : element.properties) smallest += ascii_ ? 2 : kBytes[static_cast<int>(p.is_list ? p.count_type : p.type)];
    const uint64_t left = bytes_.size() - position_ + (ascii_ ? 1 : 0);
    if (element.count > 0 && (smallest == 0 || element.count > left / smallest))
      fail("found " + std::to_string(element.count) + " elements \"" + element.name + "\" claimed by the header, but only " +
           std::to_string(left) + " bytes for them: the file is cut off");
    if (element.count > uint64_t{0xffffffff}) fail("found more than 2^32 - 1 elements \"" + element.name + "\"");
  }

  std::string_view word() {
    const size_t begin = std::min(bytes_.find_first_not_of(kBlanks, position_), bytes_.size());
    position_ = std::min(bytes_.find_first_of(kBlanks, begin), bytes_.size());
    if (begin == position_) fail("found the end of the file, expected more values");
    return bytes_.substr(begin, position_ - begin);
  }

  double number(Type type) {
    if (ascii_) {
      const std::string_view text = word();
      double value = 0;
      if (parse_number(text, value)) return value;
      if (!is_not_finite(text))
        fail("found \"" + std::string(text.substr(0, 40)) + "\" at byte " + std::to_string(position_ - text.size()) +
             ", expected a number");
      return std::numeric_limits<double>::quiet_NaN();
    }
    switch (type) {
      case Type::kInt8:
        return raw<int8_t>();
      case Type::kUint8:
        return raw<uint8_t>();
      case Type::kInt16:
        return raw<int16_t>();
      case Type::kUint16:
        return raw<uint16_t>();
      case Type::kInt32:
        return raw<int32_t>();
      case Type::kUint32:
        return raw<uint32_t>();
      case Type::kFloat:
        return static_cast<double>(raw<float>());
      case Type::kDouble:
        return raw<double>();
    }
    return 0;
  }

  template <typename T>
  T raw() {
    if (bytes_.size() - position_ < sizeof(T)) fail("found the end of the file, expected more values");
    char buffer[sizeof(T)];
    for (size_t i = 0; i < sizeof(T); ++i) buffer[swap_ ? sizeof(T) - 1 - i : i] = bytes_[position_ + i];
    position_ += sizeof(T);
    return std::bit_cast<T>(buffer_array<T>(buffer));
  }
  template <typename T>
  static std::array<char, sizeof(T)> buffer_array(const char* data) {
    std::array<char, sizeof(T)> array{};
    std::memcpy(array.data(), data, sizeof(T));
    return array;
  }

  uint64_t list_size(const Property& p) {
    const double count = number(p.count_type);
    if (!(count >= 0) || count != std::floor(count) || count > static_cast<double>(bytes_.size()))
      fail("found a list of " + std::to_string(count) + " values, expected a possible count");
    return static_cast<uint64_t>(count);
  }

  void skip_property(const Property& p) {
    const uint64_t count = p.is_list ? list_size(p) : 1;
    for (uint64_t i = 0; i < count; ++i) skip_value(p.type);
  }
  void skip_value(Type type) {
    if (ascii_)
      word();
    else
      number(type);
  }

  void skip(const Element& element) {
    for (uint64_t i = 0; i < element.count; ++i)
      for (const Property& p : element.properties) skip_property(p);
  }

  void read_vertices(const Element& element) {
    if (seen_vertices_) fail("found a second vertex element");
    seen_vertices_ = true;
    // Slots: 0-2 position, 3-5 normal, 6-7 uv.
    std::vector<int> slots(element.properties.size(), kNone);
    bool have[8] = {};
    for (size_t k = 0; k < element.properties.size(); ++k) {
      static const std::vector<std::pair<const char*, int>> kSlots{
          {"x", 0}, {"y", 1}, {"z", 2}, {"nx", 3},        {"ny", 4},        {"nz", 5},        {"u", 6},
          {"v", 7}, {"s", 6}, {"t", 7}, {"texture_u", 6}, {"texture_v", 7}, {"texture_s", 6}, {"texture_t", 7}};
      for (const auto& [name, slot] : kSlots)
        if (element.properties[k].name == name && !element.properties[k].is_list && !have[slot]) {
          slots[k] = slot;
          have[slot] = true;
        }
    }
    if (!have[0] || !have[1] || !have[2]) fail("found vertices without the properties x, y and z");
    const bool normals = have[3] && have[4] && have[5], uv = have[6] && have[7];
    mesh_.positions.reserve(element.count);
    if (normals) mesh_.normals.reserve(element.count);
    if (uv) mesh_.uv.reserve(element.count);
    for (uint64_t i = 0; i < element.count; ++i) {
      double values[8] = {};
      for (size_t k = 0; k < element.properties.size(); ++k) {
        if (slots[k] == kNone)
          skip_property(element.properties[k]);
        else
          values[slots[k]] = number(element.properties[k].type);
      }
      mesh_.positions.emplace_back(values[0], values[1], values[2]);
      if (normals) mesh_.normals.emplace_back(values[3], values[4], values[5]);
      if (uv) mesh_.uv.emplace_back(values[6], values[7]);
    }
  }

  void read_faces(const Element& element) {
    if (seen_faces_) fail("found a second face element");
    seen_faces_ = true;
    if (!seen_vertices_) fail("found faces before vertices");
    bool have_indices = false;
    for (const Property& p : element.properties) have_indices |= is_index_list(p);
    if (!have_indices) fail("found faces without a list vertex_indices");
    for (const Property& p : element.properties)
      if (is_texture_coordinate(p)) face_coordinates_ = p.name;
    for (uint64_t i = 0; i < element.count; ++i)
      for (const Property& p : element.properties) {
        if (is_index_list(p))
          read_face(p, i);
        else
          skip_property(p);
      }
  }

  /// Face properties that hold texture coordinates, by the names that exporters give them.
  static bool is_texture_coordinate(const Property& p) {
    return p.is_list && (p.name.starts_with("tex") || p.name == "uv" || p.name == "uvs" || p.name == "st");
  }

  /// What no face uses is no part of the mesh.
  void clear_unused_vertices() {
    std::vector<bool> used(mesh_.positions.size(), false);
    for (const auto& t : mesh_.triangles)
      for (const uint32_t v : t) used[v] = true;
    const auto first = std::find(used.begin(), used.end(), true);
    const DVec3 somewhere = first == used.end() ? DVec3(0) : mesh_.positions[static_cast<size_t>(first - used.begin())];
    // NaN compares with nothing.
    const auto sound = [](const auto& p) { return glm::all(glm::lessThanEqual(glm::abs(p), std::decay_t<decltype(p)>(1e18))); };
    for (size_t v = 0; v < used.size(); ++v) {
      if (used[v]) continue;
      if (!sound(mesh_.positions[v])) mesh_.positions[v] = somewhere;
      if (!mesh_.normals.empty() && !sound(mesh_.normals[v])) mesh_.normals[v] = Vec3(0);
      if (!mesh_.uv.empty() && !sound(mesh_.uv[v])) mesh_.uv[v] = Vec2(0);
    }
  }

  static bool is_index_list(const Property& p) { return p.is_list && (p.name == "vertex_indices" || p.name == "vertex_index"); }

  void read_face(const Property& p, uint64_t face) {
    const uint64_t corners = list_size(p);
    if (corners != 3 && corners != 4) {
      for (uint64_t k = 0; k < corners; ++k) skip_value(p.type);
      ++left_out_[corners];
      return;
    }
    uint32_t v[4] = {};
    for (uint64_t k = 0; k < corners; ++k) {
      const double index = number(p.type);
      if (!(index >= 0 && index < static_cast<double>(mesh_.positions.size())) || index != std::floor(index))
        fail("found the index " + std::to_string(index) + " in face " + std::to_string(face) + ", expected 0 to " +
             std::to_string(mesh_.positions.size()) + " - 1");
      v[k] = static_cast<uint32_t>(index);
    }
    mesh_.triangles.push_back({v[0], v[1], v[2]});
    if (corners == 4) mesh_.triangles.push_back({v[0], v[2], v[3]});
  }

  std::string_view bytes_;
  const std::string& name_;
  const SourceLocation& where_;
  size_t position_ = 0;
  bool ascii_ = false, swap_ = false;
  bool seen_vertices_ = false, seen_faces_ = false;
  std::string_view line_end_;
  static constexpr size_t kShownCounts = 3;
  std::map<uint64_t, uint64_t> left_out_;  ///< faces by their corners
  std::string face_coordinates_;
  std::vector<Element> elements_;
  TriangleMesh mesh_;
};

}  // namespace

TriangleMesh read_ply(std::string_view bytes, const std::string& name, const SourceLocation& where, std::vector<std::string>& warnings) {
  PlyReader reader(bytes, name, where);
  TriangleMesh mesh = reader.read();
  for (std::string& warning : reader.warnings()) warnings.push_back(std::move(warning));
  return mesh;
}

}  // namespace woodcock
