#include "renderer/film/tile.h"

#include <fmt/format.h>

#include <bit>

#include "renderer/core/sha256.h"

namespace woodcock {

// Pixels are hashed and stored as the bytes of their floats.
static_assert(std::endian::native == std::endian::little);

FilmError::FilmError(std::string_view file, std::string_view reason) : std::runtime_error(fmt::format("{}: {}", file, reason)) {}

std::string to_string(AovSet aovs) {
  std::string list;
  const auto add = [&](bool present, std::string_view word) {
    if (!present) return;
    if (!list.empty()) list += ',';
    list += word;
  };
  add(aovs.albedo, "albedo");
  add(aovs.normal, "normal");
  add(aovs.depth, "depth");
  return list.empty() ? "none" : list;
}

AovSet parse_aovs(std::string_view list) {
  AovSet aovs{false, false, false};
  if (list == "none") return aovs;
  while (true) {
    const size_t comma = list.find(',');
    const std::string_view word = list.substr(0, comma);
    if (word == "albedo") {
      aovs.albedo = true;
    } else if (word == "normal") {
      aovs.normal = true;
    } else if (word == "depth") {
      aovs.depth = true;
    } else {
      throw std::invalid_argument(fmt::format("unknown AOV '{}': expected a list of albedo, normal, depth, or none", word));
    }
    if (comma == std::string_view::npos) return aovs;
    list.remove_prefix(comma + 1);
  }
}

std::vector<std::pair<std::string, std::string>> header_fields(const FrameHeader& header) {
  std::vector<std::pair<std::string, std::string>> fields = {
      {"scene_digest", header.scene_digest},
      {"settings_digest", header.settings_digest},
      {"seed", std::to_string(header.seed)},
      {"frame", std::to_string(header.frame)},
      {"resolution", fmt::format("{}x{}", header.width, header.height)},
      {"bounds", fmt::format("{},{},{},{}", header.bounds.x0, header.bounds.y0, header.bounds.x1, header.bounds.y1)},
      {"build", header.build},
      {"arithmetic_class", header.arithmetic_class},
      {"aovs", to_string(header.aovs)},
  };
  for (const auto& [key, value] : header.settings) fields.emplace_back("setting." + key, value);
  return fields;
}

std::string header_difference(const FrameHeader& a, std::string_view name_a, const FrameHeader& b, std::string_view name_b) {
  const auto fields_a = header_fields(a), fields_b = header_fields(b);
  for (size_t i = 0; i < std::max(fields_a.size(), fields_b.size()); ++i) {
    if (i >= fields_a.size()) return fmt::format("{} has the {} '{}', {} has none", name_b, fields_b[i].first, fields_b[i].second, name_a);
    if (i >= fields_b.size()) return fmt::format("{} has the {} '{}', {} has none", name_a, fields_a[i].first, fields_a[i].second, name_b);
    if (fields_a[i] == fields_b[i]) continue;
    return fmt::format("they are not parts of one frame: {} '{}' in {}, {} '{}' in {}", fields_a[i].first, fields_a[i].second, name_a,
                       fields_b[i].first, fields_b[i].second, name_b);
  }
  return {};
}

namespace {

void add_rect(Sha256& hash, PixelRect rect) {
  for (const int v : {rect.x0, rect.y0, rect.x1, rect.y1}) hash.field(static_cast<int64_t>(v));
}

void add_header(Sha256& hash, const FrameHeader& header) {
  const auto fields = header_fields(header);
  hash.field(static_cast<int64_t>(fields.size()));
  for (const auto& [key, value] : fields) hash.field(key).field(value);
}

void add_range(Sha256& hash, SampleRange range) { hash.field(range.begin).field(range.end); }

}  // namespace

std::string result_key(const FrameHeader& header, PixelRect rect, SampleRange range) {
  Sha256 hash;
  hash.field("woodcock result key 1");
  add_header(hash, header);
  add_rect(hash, rect);
  add_range(hash, range);
  return hash.hex();
}

std::string digest_of_pixels(const FrameHeader& header, const std::vector<Tile>& nodes) {
  Sha256 hash;
  hash.field("woodcock pixels 1");
  add_header(hash, header);
  for (const Tile& node : nodes) {
    add_rect(hash, node.rect);
    add_range(hash, node.range);
    hash.field(static_cast<int64_t>(node.pixels.size())).raw(node.pixels.data(), node.pixels.size() * sizeof(PixelStats));
  }
  return hash.hex();
}

}  // namespace woodcock
