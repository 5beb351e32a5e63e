#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <functional>

#include "renderer/scene/scene_error.h"
#include "renderer/textures/image.h"

namespace woodcock {

namespace {

constexpr int kMaxSide = 16384;
constexpr uint64_t kMaxBytes = uint64_t{1} << 30;

float srgb_to_linear(float v) { return v <= 0.04045f ? v / 12.92f : std::pow((v + 0.055f) / 1.055f, 2.4f); }

/// How an integer-coded value in [0, 1] becomes linear; empty for none.
using Decoder = std::function<float(float)>;

Decoder decoder(const std::string& encoding, const SourceLocation& where) {
  if (encoding.empty() || encoding == "sRGB") return srgb_to_linear;
  if (encoding == "linear") return {};
  constexpr std::string_view kGamma = "gamma ";
  if (encoding.starts_with(kGamma)) {
    const char* begin = encoding.c_str() + kGamma.size();
    char* end = nullptr;
    const float gamma = std::strtof(begin, &end);
    if (end != begin && *end == '\0' && std::isfinite(gamma) && gamma > 0) return [gamma](float v) { return std::pow(v, gamma); };
  }
  throw SceneError(where, "found image encoding \"" + encoding + "\", expected \"sRGB\", \"linear\" or \"gamma <positive number>\"");
}

/// Which channels of the file are read: `count` adjacent ones from `first`; 1 grey, 3 RGB, 4 RGBA.
struct Channels {
  int first = 0, count = 0;
  bool unread_alpha = false;
};

std::string channel_list(const OIIO::ImageSpec& spec) {
  constexpr size_t kShown = 20;
  std::string list;
  for (size_t i = 0; i < spec.channelnames.size() && i < kShown; ++i) list += " \"" + spec.channelnames[i] + "\"";
  return list + (spec.channelnames.size() > kShown ? " …" : "");
}

Channels choose_channels(const OIIO::ImageSpec& spec, const std::string& path, const SourceLocation& where) {
  if (spec.nchannels == 1) return {0, 1};
  if (spec.nchannels == 2 && spec.alpha_channel == 1) return {0, 1, true};
  const int r = spec.channelindex("R"), g = spec.channelindex("G"), b = spec.channelindex("B");
  if (r < 0 || g != r + 1 || b != r + 2)
    throw SceneError(where, "image \"" + path + "\" has the channels" + channel_list(spec) +
                                ", expected one (grey), or R, G, B and perhaps A; write the layer that is meant to a file of its own");
  return {r, spec.alpha_channel == r + 3 ? 4 : 3};
}

void check_size(const OIIO::ImageSpec& spec, int channels, const std::string& path, const SourceLocation& where) {
  if (spec.deep || spec.depth > 1) throw SceneError(where, "image \"" + path + "\" is deep or a volume; expected a flat image");
  const auto size = [&] { return std::to_string(spec.width) + " x " + std::to_string(spec.height); };
  if (spec.width < 1 || spec.height < 1 || spec.width > kMaxSide || spec.height > kMaxSide)
    throw SceneError(where, "image \"" + path + "\" is " + size() + " pixels; expected 1 to " + std::to_string(kMaxSide) + " a side");
  const uint64_t floats = static_cast<uint64_t>(std::max(channels, 3));
  if (static_cast<uint64_t>(spec.width) * static_cast<uint64_t>(spec.height) * floats * sizeof(float) > kMaxBytes)
    throw SceneError(where, "image \"" + path + "\" is " + size() + " pixels, more than 1 GiB in memory; reduce it");
}

/// Spreads `raw` (`channels` floats a pixel) over colour and alpha.
void fill(Image& image, const std::vector<float>& raw, int channels) {
  const size_t n = static_cast<size_t>(image.width) * static_cast<size_t>(image.height), stride = static_cast<size_t>(channels);
  const bool colour = channels >= 3, with_alpha = channels == 4;
  image.pixels.resize(n);
  for (size_t i = 0; i < n; ++i) {
    const float* p = &raw[i * stride];
    image.pixels[i] = colour ? Rgb(p[0], p[1], p[2]) : Rgb(p[0]);
  }
  if (!with_alpha) return;
  bool opaque = true;
  for (size_t i = 0; i < n; ++i) opaque = opaque && raw[i * stride + stride - 1] == 1;
  if (opaque) return;
  image.alpha.resize(n);
  for (size_t i = 0; i < n; ++i) image.alpha[i] = raw[i * stride + stride - 1];
}

void count_negatives(Image& image) {
  for (const Rgb& p : image.pixels) {
    const float least = min_component(p);
    if (least >= 0) continue;
    ++image.negative_pixels;
    image.smallest = std::min(image.smallest, least);
  }
}

/// Decodes integer-coded colours. Eight-bit ones have 256 values, so a table does.
void linearise(Image& image, const Decoder& decode, bool eight_bit) {
  if (!decode) return;
  if (!eight_bit) {
    for (Rgb& p : image.pixels) p = {decode(p.r), decode(p.g), decode(p.b)};
    return;
  }
  std::array<float, 256> table;
  for (size_t i = 0; i < table.size(); ++i) table[i] = decode(static_cast<float>(i) / 255.0f);
  const auto entry = [&](float v) { return table[static_cast<size_t>(std::lround(std::clamp(v, 0.0f, 1.0f) * 255))]; };
  for (Rgb& p : image.pixels) p = {entry(p.r), entry(p.g), entry(p.b)};
}

void check_finite(const Image& image, const std::string& path, const SourceLocation& where) {
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    if (is_finite(image.pixels[i]) && (image.alpha.empty() || std::isfinite(image.alpha[i]))) continue;
    const size_t w = static_cast<size_t>(image.width);
    throw SceneError(where, "image \"" + path + "\" has a value that is not finite at pixel (" + std::to_string(i % w) + ", " +
                                std::to_string(i / w) + "); repair the image");
  }
}

Image read(const std::string& path, const Decoder& decode, const SourceLocation& where) {
  OIIO::ImageSpec hints;
  hints["oiio:UnassociatedAlpha"] = 1;  // colours as they are in the file, not multiplied by alpha
  const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path, &hints);
  if (!input) throw SceneError(where, "cannot read image \"" + path + "\": " + OIIO::geterror());
  const OIIO::ImageSpec& spec = input->spec();
  const Channels channels = choose_channels(spec, path, where);
  check_size(spec, channels.count, path, where);
  Image image;
  image.file = std::filesystem::path(path).filename().string();
  image.has_unread_alpha = channels.unread_alpha;
  image.width = spec.width;
  image.height = spec.height;
  std::vector<float> raw(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height) * static_cast<size_t>(channels.count));
  const bool integers = !spec.format.is_floating_point(), eight_bit = spec.format == OIIO::TypeDesc::UINT8;
  if (!input->read_image(0, 0, channels.first, channels.first + channels.count, OIIO::TypeDesc::FLOAT, raw.data()))
    throw SceneError(where, "cannot read image \"" + path + "\": " + input->geterror());
  fill(image, raw, channels.count);
  check_finite(image, path, where);
  if (integers)
    linearise(image, decode, eight_bit);
  else
    count_negatives(image);
  return image;
}

}  // namespace

Image load_image(const std::string& path, const std::string& encoding, const SourceLocation& where) {
  const Decoder decode = decoder(encoding, where);
  // A pipe or a device would block or never end.
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) throw SceneError(where, "cannot read image \"" + path + "\": no such regular file");
  try {
    return read(path, decode, where);
  } catch (const SceneError&) {
    throw;
  } catch (const std::exception& e) {  // codecs throw on some damaged files; an allocation may fail
    throw SceneError(where, "cannot read image \"" + path + "\": " + e.what());
  }
}

}  // namespace woodcock
