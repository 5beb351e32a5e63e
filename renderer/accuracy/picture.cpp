#include "renderer/accuracy/picture.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "renderer/film/atomic_file.h"
#include "renderer/film/exr.h"
#include "renderer/film/node.h"
#include "renderer/film/png.h"
#include "renderer/film/tile.h"

namespace woodcock {

double srgb_encode(double v) { return v <= 0.0031308 ? 12.92 * v : 1.055 * std::pow(v, 1 / 2.4) - 0.055; }
double srgb_decode(double v) { return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4); }

std::vector<float> Picture::luminances() const {
  std::vector<float> values;
  values.reserve(pixels.size());
  for (const Rgb& pixel : pixels) values.push_back(film::sample_luminance(pixel));
  return values;
}

Picture displayed(const Picture& picture) {
  Picture result = picture;
  for (Rgb& pixel : result.pixels)
    for (int c = 0; c < 3; ++c) pixel[c] = std::clamp(pixel[c], 0.0f, 1.0f);
  return result;
}

Picture read_picture(const std::filesystem::path& path) {
  const auto refuse = [&](std::string_view reason) { throw FilmError(path.string(), reason); };
  const auto input = OIIO::ImageInput::open(path.string());
  if (!input) refuse(fmt::format("cannot be read: {}", OIIO::geterror()));
  const OIIO::ImageSpec spec = input->spec();
  if (spec.width < 1 || spec.height < 1 || spec.nchannels > 1024 || int64_t{spec.width} * spec.height > kMaxPixels)
    refuse("its size is beyond what is read");
  int channel[3];
  for (int c = 0; c < 3; ++c) {
    channel[c] = spec.channelindex(std::string(1, "RGB"[c]));
    if (channel[c] < 0) refuse(fmt::format("it has no channel {}", "RGB"[c]));
  }
  const bool encoded = !spec.format.is_floating_point();
  Picture picture{spec.width, spec.height, {}};
  picture.pixels.resize(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height));
  std::vector<float> row(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.nchannels));
  for (int y = 0; y < spec.height; ++y) {
    if (!input->read_scanlines(0, 0, spec.y + y, spec.y + y + 1, 0, 0, spec.nchannels, OIIO::TypeFloat, row.data()))
      refuse(fmt::format("row {} cannot be read: {}", y, input->geterror()));
    for (int x = 0; x < spec.width; ++x) {
      const float* in = row.data() + static_cast<size_t>(x) * static_cast<size_t>(spec.nchannels);
      Rgb value{in[channel[0]], in[channel[1]], in[channel[2]]};
      if (!is_finite(value)) refuse(fmt::format("pixel ({}, {}) is not finite", x, y));
      for (int c = 0; encoded && c < 3; ++c) value[c] = static_cast<float>(srgb_decode(static_cast<double>(value[c])));
      picture.pixels[static_cast<size_t>(y) * static_cast<size_t>(spec.width) + static_cast<size_t>(x)] = value;
    }
  }
  return picture;
}

void write_picture_png(const Picture& picture, const std::filesystem::path& png) {
  const auto output = OIIO::ImageOutput::create("png");
  if (!output) throw FilmError(png.string(), OIIO::geterror());
  std::vector<unsigned char> codes;
  for (const Rgb& pixel : picture.pixels)
    for (int c = 0; c < 3; ++c) codes.push_back(srgb8(pixel[c]));
  OIIO::ImageSpec spec(picture.width, picture.height, 3, OIIO::TypeUInt8);
  spec.attribute("oiio:ColorSpace", "sRGB");
  AtomicFile file(png);
  if (!output->open(file.path().string(), spec) || !output->write_image(OIIO::TypeUInt8, codes.data()) || !output->close())
    throw FilmError(png.string(), output->geterror());
  file.commit();
}

}  // namespace woodcock
