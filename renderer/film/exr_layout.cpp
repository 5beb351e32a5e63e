#include "renderer/film/exr_layout.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cstddef>
#include <map>
#include <optional>

namespace woodcock::exr {

namespace {

constexpr std::string_view kPrefix = "woodcock:";
constexpr std::string_view kSetting = "setting.";
constexpr std::string_view kFormat = "2";
constexpr std::string_view kPictureFormat = "picture 1";

[[noreturn]] void refuse(std::string_view name, std::string_view reason) { throw FilmError(name, reason); }

std::string range_text(SampleRange r) { return fmt::format("{}:{}", r.begin, r.end); }

/// Reads integers separated by single characters of `separators`; nothing else may be there.
template <size_t N>
std::optional<std::array<int64_t, N>> parse_integers(std::string_view text, std::string_view separators) {
  std::array<int64_t, N> values;
  const char* at = text.data();
  const char* end = at + text.size();
  for (size_t i = 0; i < N; ++i) {
    const auto [next, error] = std::from_chars(at, end, values[i]);
    if (error != std::errc{}) return std::nullopt;
    at = next;
    if (i + 1 == N) break;
    if (at == end || *at != separators[i]) return std::nullopt;
    ++at;
  }
  return at == end ? std::optional(values) : std::nullopt;
}

std::optional<SampleRange> parse_range(std::string_view text) {
  const auto v = parse_integers<2>(text, ":");
  return v ? std::optional(SampleRange{(*v)[0], (*v)[1]}) : std::nullopt;
}

bool fits_side(int64_t v) { return v >= 0 && v <= kMaxSide; }

std::optional<PixelRect> make_rect(int64_t x0, int64_t y0, int64_t x1, int64_t y1) {
  if (!fits_side(x0) || !fits_side(y0) || !fits_side(x1) || !fits_side(y1)) return std::nullopt;
  return PixelRect{static_cast<int>(x0), static_cast<int>(y0), static_cast<int>(x1), static_cast<int>(y1)};
}

std::string gaps_text(const std::vector<Gap>& gaps) {
  std::string text;
  for (size_t i = 0; i < std::min(gaps.size(), kMaxListedGaps); ++i) {
    const auto& [rect, range] = gaps[i];
    text += fmt::format("{}{},{},{},{}:{}:{}", i ? ";" : "", rect.x0, rect.y0, rect.x1, rect.y1, range.begin, range.end);
  }
  return text;
}

std::optional<std::vector<Gap>> parse_gaps(std::string_view text) {
  std::vector<Gap> gaps;
  while (!text.empty()) {
    const size_t end = std::min(text.find(';'), text.size());
    const auto v = parse_integers<6>(text.substr(0, end), ",,,::");
    const auto rect = v ? make_rect((*v)[0], (*v)[1], (*v)[2], (*v)[3]) : std::nullopt;
    if (!rect || gaps.size() == kMaxListedGaps) return std::nullopt;
    gaps.push_back({*rect, {(*v)[4], (*v)[5]}});
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return gaps;
}

bool is_plain_text(std::string_view text) {
  return text.size() <= 65536 && std::none_of(text.begin(), text.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; });
}

/// The string attributes with our prefix, and getters that refuse what is absent or malformed.
class Fields {
 public:
  Fields(const OIIO::ImageSpec& spec, std::string_view name) : name_(name) {
    for (const auto& attribute : spec.extra_attribs) {
      const std::string key = attribute.name().string();
      if (key.starts_with(kPrefix) && attribute.type() == OIIO::TypeString) values_[key.substr(kPrefix.size())] = attribute.get_string();
    }
  }

  std::optional<std::string> find(const std::string& key) const {
    const auto it = values_.find(key);
    return it == values_.end() ? std::nullopt : std::optional(it->second);
  }
  std::string get(const std::string& key) const {
    const auto value = find(key);
    if (!value) refuse(name_, fmt::format("is not a node file: it has no attribute '{}{}'", kPrefix, key));
    return *value;
  }
  [[noreturn]] void malformed(const std::string& key) const {
    refuse(name_, fmt::format("the attribute '{}{}' is '{}', which makes no sense", kPrefix, key, find(key).value_or("").substr(0, 100)));
  }
  /// How many begin with `prefix`.
  size_t count(std::string_view prefix) const {
    return static_cast<size_t>(std::count_if(values_.begin(), values_.end(), [&](const auto& v) { return v.first.starts_with(prefix); }));
  }
  uint64_t number(const std::string& key) const {
    const std::string text = get(key);
    uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) malformed(key);
    return value;
  }

 private:
  std::string_view name_;
  std::map<std::string, std::string> values_;
};

/// The settings in the order they were written: an EXR file sorts attributes by name, so the order is kept in a field.
std::string order_text(const FrameHeader& header) {
  std::string text;
  for (const auto& [key, value] : header.settings) text += (text.empty() ? "" : ",") + key;
  return text;
}

PixelRect window(const OIIO::ImageSpec& spec) {
  // 64-bit sums: a hostile window may overflow int. check_info refuses what does not fit.
  const int64_t x1 = int64_t{spec.x} + spec.width, y1 = int64_t{spec.y} + spec.height;
  return make_rect(spec.x, spec.y, x1, y1).value_or(PixelRect{});
}

void check_map(const NodeFileInfo& info, std::string_view name) {
  const SampleMap& map = *info.map;
  if (!(map.rect == info.rect) || map.counts.size() != map.grid().size()) refuse(name, "its sample map is not one of its pixels");
  if (std::any_of(map.counts.begin(), map.counts.end(), [](int64_t n) { return n < 0 || n > kMaxMapSamples; }))
    refuse(name, fmt::format("a count of its sample map is outside 0 to {}", kMaxMapSamples));
  if (map.uniform()) refuse(name, "its sample map has one count only, where a range says the same");
  if (!(info.samples == SampleRange{0, map.largest()})) refuse(name, "its samples are not those of its sample map");
  if (info.nodes.size() >= kMaxParts) refuse(name, "its sample map has more different counts than a file has parts");
}

void add_one(std::vector<Channel>& list, std::string name, size_t bytes) { list.push_back({std::move(name), bytes / sizeof(float)}); }

void add_three(std::vector<Channel>& list, const std::array<const char*, 3>& names, size_t bytes) {
  for (size_t c = 0; c < 3; ++c) add_one(list, names[c], bytes + c * sizeof(float));
}

void add_geometry(std::vector<Channel>& list, AovSet aovs) {
  if (aovs.normal) add_three(list, {"normal.X", "normal.Y", "normal.Z"}, offsetof(PixelStats, normal));
  if (aovs.depth) add_one(list, "depth.Z", offsetof(PixelStats, depth));
}

/// Windows, format and compression, which all parts of node files and pictures share.
OIIO::ImageSpec spec_of(const NodeFileInfo& info, const std::vector<Channel>& list) {
  OIIO::ImageSpec spec(info.rect.width(), info.rect.height(), static_cast<int>(list.size()), OIIO::TypeFloat);
  for (size_t c = 0; c < list.size(); ++c) spec.channelnames[c] = list[c].name;
  spec.x = info.rect.x0;
  spec.y = info.rect.y0;
  spec.full_x = spec.full_y = 0;
  spec.full_width = info.header.width;
  spec.full_height = info.header.height;
  spec.attribute("compression", "zip:4");
  // OpenImageIO writes the time of day unless there is a date; an empty one says nothing.
  spec.attribute("DateTime", "");
  return spec;
}

void put(OIIO::ImageSpec& spec, std::string_view key, const std::string& value) {
  spec.attribute(fmt::format("{}{}", kPrefix, key), value);
}

void put_number(OIIO::ImageSpec& spec, std::string_view key, float value) { spec.attribute(fmt::format("{}{}", kPrefix, key), value); }

/// What the frame is: the header of a node file's first part, and of a picture.
void put_frame(OIIO::ImageSpec& spec, const NodeFileInfo& info) {
  put(spec, "samples", range_text(info.samples));
  if (info.map) put(spec, "map", to_text(info.map->counts));
  for (const auto& [key, value] : header_fields(info.header)) put(spec, key, value);
  put(spec, "setting_order", order_text(info.header));
  if (info.missing_pixels > 0) {
    put(spec, "missing_pixels", std::to_string(info.missing_pixels));
    put(spec, "gap_count", std::to_string(info.gaps.size()));
    put(spec, "gaps", gaps_text(info.gaps));
  }
}

}  // namespace

std::vector<Channel> channels(AovSet aovs) {
  std::vector<Channel> list;
  add_three(list, {"R", "G", "B"}, offsetof(PixelStats, mean));
  add_three(list, {"deviation.R", "deviation.G", "deviation.B"}, offsetof(PixelStats, deviation));
  for (size_t k = 0; k < kReplicates; ++k)
    add_one(list, fmt::format("replicate.{}", k), offsetof(PixelStats, replicate) + k * sizeof(float));
  add_one(list, "largest", offsetof(PixelStats, largest));
  add_one(list, "count", offsetof(PixelStats, count));
  if (aovs.albedo) add_three(list, {"albedo.R", "albedo.G", "albedo.B"}, offsetof(PixelStats, albedo));
  add_geometry(list, aovs);
  return list;
}

std::vector<Channel> picture_channels(AovSet aovs) {
  std::vector<Channel> list;
  add_three(list, {"R", "G", "B"}, offsetof(PixelStats, mean));
  add_one(list, "count", offsetof(PixelStats, count));
  if (aovs.albedo) add_three(list, {"albedo.red", "albedo.green", "albedo.blue"}, offsetof(PixelStats, albedo));
  add_geometry(list, aovs);
  return list;
}

std::vector<SampleRange> nodes_of(const NodeFileInfo& info) { return info.map ? map_nodes(*info.map) : dyadic_nodes(info.samples); }

size_t part_count(const NodeFileInfo& info) { return has_fold(info) ? info.nodes.size() + 1 : info.nodes.size(); }

void check_info(const NodeFileInfo& info, std::string_view name) {
  const FrameHeader& header = info.header;
  if (header.width < 1 || header.height < 1 || header.width > kMaxSide || header.height > kMaxSide)
    refuse(name, fmt::format("the resolution {}x{} is outside 1 to {}", header.width, header.height, kMaxSide));
  const PixelRect full{0, 0, header.width, header.height};
  if (header.bounds.empty() || !full.contains(header.bounds)) refuse(name, "the frame's bounds are not inside its resolution");
  if (info.rect.empty() || !header.bounds.contains(info.rect)) refuse(name, "its pixels are not inside the frame's bounds");
  if (info.rect.area() > kMaxPixels) refuse(name, fmt::format("{} pixels are more than the {} allowed", info.rect.area(), kMaxPixels));
  if (info.map) check_map(info, name);
  if (info.nodes.empty()) refuse(name, fmt::format("the sample range {} makes no sense", range_text(info.samples)));
  if (info.missing_pixels < 0 || info.missing_pixels > info.rect.area()) refuse(name, "the number of missing pixels makes no sense");
  for (const Gap& gap : info.gaps)
    if (gap.rect.empty() || !info.rect.contains(gap.rect) || gap.range.empty() || !info.samples.contains(gap.range))
      refuse(name, "a gap is listed outside the file's pixels and samples");
  if (header.settings.size() > 200) refuse(name, "more than 200 settings");
  for (const auto& [key, value] : header_fields(header)) {
    // '#' would end nothing and ',' separates the keys in their list.
    const bool good_key = key.size() <= 200 && std::all_of(key.begin(), key.end(), [](char c) {
                            return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
                          });
    if (!good_key || !is_plain_text(value)) refuse(name, fmt::format("the header field '{}' has characters that cannot be written", key));
  }
  for (const auto& [key, value] : header.settings)
    if (key.empty() || value.empty()) refuse(name, fmt::format("the setting '{}' is empty: such an attribute would not be written", key));
  for (size_t i = 0; i < header.settings.size(); ++i)
    for (size_t j = 0; j < i; ++j)
      if (header.settings[i].first == header.settings[j].first)
        refuse(name, fmt::format("the setting '{}' is there twice", header.settings[i].first));
}

OIIO::ImageSpec part_spec(const NodeFileInfo& info, size_t index, const std::vector<std::string>& numbers) {
  OIIO::ImageSpec spec = spec_of(info, channels(info.header.aovs));
  const bool fold = has_fold(info) && index == 0;
  const SampleRange range = fold ? info.samples : info.nodes[has_fold(info) ? index - 1 : index];
  spec.attribute("oiio:subimagename", index == 0 ? std::string("beauty") : "samples " + range_text(range));
  put(spec, "node", fold ? "fold" : range_text(range));
  if (index != 0) return spec;
  put(spec, "format", std::string(kFormat));
  put_frame(spec, info);
  for (const std::string& number : numbers) put_number(spec, number, 0);
  return spec;
}

OIIO::ImageSpec picture_spec(const NodeFileInfo& info, const std::vector<std::pair<std::string, float>>& numbers,
                             const std::string& nodes_digest) {
  OIIO::ImageSpec spec = spec_of(info, picture_channels(info.header.aovs));
  put(spec, "format", std::string(kPictureFormat));
  put(spec, "nodes_digest", nodes_digest);
  put_frame(spec, info);
  for (const auto& [number, value] : numbers) put_number(spec, number, value);
  return spec;
}

FileKind kind_of(const OIIO::ImageSpec& spec) {
  const std::string format = spec.get_string_attribute(std::string(kPrefix) + "format");
  return format.empty() ? FileKind::kOther : format.starts_with("picture") ? FileKind::kPicture : FileKind::kNodes;
}

std::vector<std::pair<std::string, float>> numbers_of(const OIIO::ImageSpec& spec) {
  std::vector<std::pair<std::string, float>> numbers;
  for (const auto& attribute : spec.extra_attribs) {
    const std::string key = attribute.name().string();
    if (key.starts_with(kPrefix) && attribute.type() == OIIO::TypeFloat)
      numbers.emplace_back(key.substr(kPrefix.size()), attribute.get_float());
  }
  return numbers;
}

namespace {

NodeFileInfo parse_frame(const Fields& fields, const OIIO::ImageSpec& spec, std::string_view name) {
  NodeFileInfo info;
  info.rect = window(spec);
  const auto samples = parse_range(fields.get("samples"));
  if (!samples) fields.malformed("samples");
  info.samples = *samples;
  if (const auto map = fields.find("map")) {
    if (info.rect.empty() || info.rect.area() > kMaxPixels) refuse(name, "has a sample map of an impossible size");
    auto counts = parse_counts(*map, BlockGrid{info.rect}.size());
    if (!counts) fields.malformed("map");
    info.map = SampleMap{info.rect, std::move(*counts)};
  }
  info.nodes = nodes_of(info);

  FrameHeader& header = info.header;
  header.scene_digest = fields.get("scene_digest");
  header.settings_digest = fields.get("settings_digest");
  header.seed = fields.number("seed");
  header.frame = fields.number("frame");
  const auto resolution = parse_integers<2>(fields.get("resolution"), "x");
  if (!resolution || !fits_side((*resolution)[0]) || !fits_side((*resolution)[1])) fields.malformed("resolution");
  header.width = static_cast<int>((*resolution)[0]);
  header.height = static_cast<int>((*resolution)[1]);
  const auto b = parse_integers<4>(fields.get("bounds"), ",,,");
  const auto bounds = b ? make_rect((*b)[0], (*b)[1], (*b)[2], (*b)[3]) : std::nullopt;
  if (!bounds) fields.malformed("bounds");
  header.bounds = *bounds;
  header.build = fields.get("build");
  header.arithmetic_class = fields.get("arithmetic_class");
  try {
    header.aovs = parse_aovs(fields.get("aovs"));
  } catch (const std::invalid_argument&) {
    fields.malformed("aovs");
  }
  // OpenImageIO writes no empty attribute: a frame without settings has no list of them.
  const std::string order = fields.find("setting_order").value_or("");
  for (size_t at = 0; at < order.size();) {
    const size_t end = std::min(order.find(',', at), order.size());
    const std::string key = order.substr(at, end - at);
    header.settings.emplace_back(key, fields.get(fmt::format("{}{}", kSetting, key)));
    at = end + 1;
  }
  if (header.settings.size() != fields.count(kSetting)) fields.malformed("setting_order");
  if (fields.find("missing_pixels")) {
    const uint64_t missing = fields.number("missing_pixels");
    if (missing == 0 || missing > static_cast<uint64_t>(kMaxPixels)) fields.malformed("missing_pixels");
    info.missing_pixels = static_cast<int64_t>(missing);
    const auto gaps = parse_gaps(fields.get("gaps"));
    if (!gaps) fields.malformed("gaps");
    info.gaps = *gaps;
  }
  check_info(info, name);
  return info;
}

}  // namespace

NodeFileInfo parse_info(const OIIO::ImageSpec& spec, std::string_view name) {
  const Fields fields(spec, name);
  if (kind_of(spec) == FileKind::kPicture)
    refuse(name, "is a picture: what is needed here are its nodes, the file whose name ends in .nodes.exr beside it");
  if (const std::string format = fields.get("format"); format != kFormat)
    refuse(name, fmt::format("is a node file of format '{}'; this program reads format {}", format.substr(0, 100), kFormat));
  return parse_frame(fields, spec, name);
}

NodeFileInfo parse_picture_info(const OIIO::ImageSpec& spec, std::string_view name) {
  const Fields fields(spec, name);
  if (const std::string format = fields.get("format"); format != kPictureFormat)
    refuse(name, fmt::format("is a picture of format '{}'; this program reads format '{}'", format.substr(0, 100), kPictureFormat));
  return parse_frame(fields, spec, name);
}

std::string parse_nodes_digest(const OIIO::ImageSpec& spec, std::string_view name) { return Fields(spec, name).get("nodes_digest"); }

void check_part(const OIIO::ImageSpec& spec, const NodeFileInfo& info, size_t index, std::string_view name) {
  const auto wrong = [&](std::string_view what) { refuse(name, fmt::format("part {}: {}", index, what)); };
  if (spec.deep || spec.tile_width != 0 || spec.depth != 1) wrong("is not a flat image stored by rows");
  if (!(window(spec) == info.rect)) wrong("its data window differs from the first part's");
  if (spec.full_x != 0 || spec.full_y != 0 || spec.full_width != info.header.width || spec.full_height != info.header.height)
    wrong("its display window is not the full image");
  const OIIO::ImageSpec expected = part_spec(info, index);
  std::vector<std::string> have = spec.channelnames, want = expected.channelnames;
  std::sort(have.begin(), have.end());
  std::sort(want.begin(), want.end());
  if (have != want)
    wrong(fmt::format("its {} channels are not those of a node file with the AOVs {}", have.size(), to_string(info.header.aovs)));
  for (int c = 0; c < spec.nchannels; ++c)
    if (spec.channelformat(c) != OIIO::TypeFloat) wrong(fmt::format("channel {} is not float32", spec.channel_name(c)));
  const std::string node = std::string(kPrefix) + "node";
  if (spec.get_string_attribute(node) != expected.get_string_attribute(node)) wrong("it does not hold the samples it should");
}

}  // namespace woodcock::exr
