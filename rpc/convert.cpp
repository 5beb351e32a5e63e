#include "rpc/convert.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "renderer/film/exr.h"
#include "rpc/error.h"
#include "rpc/limits.h"

namespace woodcock::rpc {
namespace {

void check(bool ok, std::string_view field, std::string_view expected) {
  if (!ok) fail_invalid(std::string(field) + ": expected " + std::string(expected));
}

bool is_key(std::string_view text) {
  return !text.empty() && text.size() <= kMaxIdBytes && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_' || c == '.';
  });
}

void check_resolution(const v1::Resolution& resolution, std::string_view field) {
  const bool ok =
      resolution.width() >= 1 && resolution.height() >= 1 && resolution.width() <= kMaxResolution && resolution.height() <= kMaxResolution;
  check(ok, field, "1 to 65536 pixels an edge");
}

/// What the estimator is set by; whether it takes these options is the renderer's to say.
void set_estimator_options(const v1::RenderSettings& settings, FrameSettings& domain) {
  const auto count = [](int32_t value, std::string_view field) {
    check(value >= 1 && value <= kMaxDirections, field, "1 to 1024");
    return value;
  };
  check(settings.only().size() <= kMaxIdBytes && is_plain_text(settings.only()), "settings.only", "terms, at most 64 bytes");
  domain.only = settings.only();
  if (settings.has_step()) {
    check(std::isfinite(settings.step()) && settings.step() > 0, "settings.step", "a finite positive length");
    domain.step = settings.step();
  }
  if (settings.has_directions()) domain.directions = count(settings.directions(), "settings.directions");
  if (settings.has_branching()) domain.branching = count(settings.branching(), "settings.branching");
  domain.full_kernel = settings.full_kernel();
  domain.plan = !settings.plan_off();
  check(settings.without().size() <= kMaxListBytes && is_plain_text(settings.without()), "settings.without", "features, at most 512 bytes");
  domain.without = settings.without();
  // Whether the scene has what they name is the reader's to say.
  size_t bytes = 0;
  for (const std::string& set : settings.set()) {
    check(is_plain_text(set), "settings.set", "text without control characters");
    bytes += set.size();
  }
  check(settings.set_size() <= kMaxSetParameters && bytes <= kMaxSetBytes, "settings.set", "at most 32 texts of together 4096 bytes");
  domain.set.assign(settings.set().begin(), settings.set().end());
}

}  // namespace

bool is_digest(std::string_view text) {
  return text.size() == 64 &&
         std::all_of(text.begin(), text.end(), [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
}

const std::string& checked_digest(const std::string& text, std::string_view field) {
  check(is_digest(text), field, "a SHA-256 digest as 64 lower-case hexadecimal digits");
  return text;
}

bool is_identifier(std::string_view text) {
  return !text.empty() && text.size() <= kMaxIdBytes && text[0] != '.' && std::all_of(text.begin(), text.end(), [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
  });
}

bool is_plain_text(std::string_view text) {
  return std::none_of(text.begin(), text.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

v1::PixelRect to_wire(const PixelRect& rect) {
  v1::PixelRect wire;
  wire.set_x0(rect.x0);
  wire.set_y0(rect.y0);
  wire.set_x1(rect.x1);
  wire.set_y1(rect.y1);
  return wire;
}

v1::SampleRange to_wire(const SampleRange& range) {
  v1::SampleRange wire;
  wire.set_begin(range.begin);
  wire.set_end(range.end);
  return wire;
}

PixelRect from_wire(const v1::PixelRect& rect, std::string_view field) {
  const PixelRect domain{rect.x0(), rect.y0(), rect.x1(), rect.y1()};
  const bool ok = domain.x0 >= 0 && domain.y0 >= 0 && domain.x0 < domain.x1 && domain.y0 < domain.y1 && domain.x1 <= kMaxResolution &&
                  domain.y1 <= kMaxResolution && domain.area() <= kMaxPixels;
  check(ok, field, "0 <= x0 < x1 <= 65536, 0 <= y0 < y1 <= 65536 and at most 2^28 pixels");
  return domain;
}

SampleRange from_wire(const v1::SampleRange& range, std::string_view field) {
  const SampleRange domain{range.begin(), range.end()};
  check(domain.begin >= 0 && domain.begin < domain.end && domain.end <= kMaxSamplesPerPixel, field, "0 <= begin < end <= 2^40");
  return domain;
}

v1::RenderSettings to_wire(const FrameSettings& settings, int tile_size) {
  v1::RenderSettings wire;
  if (settings.resolution) {
    wire.mutable_resolution()->set_width((*settings.resolution)[0]);
    wire.mutable_resolution()->set_height((*settings.resolution)[1]);
  }
  if (settings.crop) {
    const auto& c = *settings.crop;
    *wire.mutable_crop() = to_wire(PixelRect{c[0], c[2], c[1], c[3]});
  }
  if (settings.samples) wire.set_samples(*settings.samples);
  if (settings.seed) wire.set_seed(*settings.seed);
  if (settings.max_depth) wire.set_max_depth(*settings.max_depth);
  wire.set_estimator(settings.estimator);
  wire.set_aovs(settings.aovs);
  wire.set_allow_unsupported(settings.allow_unsupported);
  wire.set_tile_size(static_cast<uint32_t>(tile_size));
  wire.set_only(settings.only);
  if (settings.step) wire.set_step(*settings.step);
  if (settings.directions) wire.set_directions(*settings.directions);
  if (settings.branching) wire.set_branching(*settings.branching);
  wire.set_full_kernel(settings.full_kernel);
  wire.set_plan_off(!settings.plan);
  wire.set_without(settings.without);
  for (const std::string& set : settings.set) wire.add_set(set);
  return wire;
}

FrameSettings from_wire(const v1::RenderSettings& settings, uint64_t frame) {
  FrameSettings domain;
  if (settings.has_resolution()) {
    check_resolution(settings.resolution(), "settings.resolution");
    domain.resolution = {settings.resolution().width(), settings.resolution().height()};
  }
  if (settings.has_crop()) {
    const PixelRect crop = from_wire(settings.crop(), "settings.crop");
    domain.crop = {crop.x0, crop.x1, crop.y0, crop.y1};
  }
  if (settings.has_samples()) {
    check(settings.samples() >= 1 && settings.samples() <= kMaxSamplesPerPixel, "settings.samples", "1 to 2^40");
    domain.samples = settings.samples();
  }
  if (settings.has_seed()) domain.seed = settings.seed();
  if (settings.has_max_depth()) {
    check(settings.max_depth() >= 0, "settings.max_depth", "0 or more");
    domain.max_depth = settings.max_depth();
  }
  check(settings.estimator().size() <= kMaxIdBytes && is_plain_text(settings.estimator()), "settings.estimator",
        "an estimator's name of at most 64 bytes");
  if (!settings.estimator().empty()) domain.estimator = settings.estimator();
  if (!settings.aovs().empty()) {
    check(settings.aovs().size() <= kMaxIdBytes, "settings.aovs", "at most 64 bytes");
    try {
      domain.aovs = woodcock::to_string(parse_aovs(settings.aovs()));
    } catch (const std::invalid_argument& error) {
      fail_invalid(std::string("settings.aovs: ") + error.what());
    }
  }
  domain.allow_unsupported = settings.allow_unsupported();
  set_estimator_options(settings, domain);
  domain.frame = frame;
  return domain;
}

v1::FrameHeader to_wire(const FrameHeader& header) {
  v1::FrameHeader wire;
  wire.mutable_resolution()->set_width(header.width);
  wire.mutable_resolution()->set_height(header.height);
  *wire.mutable_pixel_bounds() = to_wire(header.bounds);
  wire.set_scene_digest(header.scene_digest);
  wire.set_settings_digest(header.settings_digest);
  wire.set_seed(header.seed);
  wire.set_frame(header.frame);
  wire.set_build(header.build);
  wire.set_arithmetic_class(header.arithmetic_class);
  wire.set_aovs(to_string(header.aovs));
  for (const auto& [key, value] : header.settings) {
    v1::HeaderSetting* setting = wire.add_settings();
    setting->set_key(key);
    setting->set_value(value);
  }
  return wire;
}

FrameHeader from_wire(const v1::FrameHeader& wire) {
  FrameHeader header;
  check_resolution(wire.resolution(), "header.resolution");
  header.width = wire.resolution().width();
  header.height = wire.resolution().height();
  header.bounds = from_wire(wire.pixel_bounds(), "header.pixel_bounds");
  check(PixelRect{0, 0, header.width, header.height}.contains(header.bounds), "header.pixel_bounds", "pixels of the full image");
  header.scene_digest = checked_digest(wire.scene_digest(), "header.scene_digest");
  header.settings_digest = checked_digest(wire.settings_digest(), "header.settings_digest");
  header.seed = wire.seed();
  header.frame = wire.frame();
  check(wire.build().size() <= kMaxBuildBytes && is_plain_text(wire.build()), "header.build", "at most 256 bytes of text");
  header.build = wire.build();
  check(wire.arithmetic_class().size() <= kMaxBuildBytes && is_plain_text(wire.arithmetic_class()), "header.arithmetic_class",
        "at most 256 bytes of text");
  header.arithmetic_class = wire.arithmetic_class();
  try {
    header.aovs = parse_aovs(wire.aovs());
  } catch (const std::invalid_argument& error) {
    fail_invalid(std::string("header.aovs: ") + error.what());
  }
  check(static_cast<size_t>(wire.settings_size()) <= kMaxSettings, "header.settings", "at most 256 entries");
  for (const v1::HeaderSetting& setting : wire.settings()) {
    check(is_key(setting.key()), "header.settings.key", "lower-case words with '_' or '.', at most 64 bytes");
    check(setting.value().size() <= kMaxSettingBytes && is_plain_text(setting.value()), "header.settings.value",
          "at most 4096 bytes without control characters");
    const bool known = std::any_of(header.settings.begin(), header.settings.end(), [&](const auto& s) { return s.first == setting.key(); });
    check(!known, "header.settings.key", "each key once");
    header.settings.emplace_back(setting.key(), setting.value());
  }
  return header;
}

v1::ProtocolVersion this_protocol() {
  v1::ProtocolVersion version;
  version.set_major(kProtocolMajor);
  version.set_minor(kProtocolMinor);
  return version;
}

}  // namespace woodcock::rpc
