#include "renderer/film/png.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "renderer/film/atomic_file.h"
#include "renderer/film/exr.h"

namespace woodcock {

unsigned char srgb8(float linear) {
  const float v = std::clamp(linear, 0.0f, 1.0f);
  const float encoded = v <= 0.0031308f ? 12.92f * v : 1.055f * std::pow(v, 1 / 2.4f) - 0.055f;
  return static_cast<unsigned char>(std::lround(255 * encoded));
}

std::string encode_png(int width, int height, std::span<const unsigned char> codes) {
  const auto output = OIIO::ImageOutput::create("png");
  if (!output) throw FilmError("PNG in memory", OIIO::geterror());
  const auto check = [&](bool ok) {
    if (!ok) throw FilmError("PNG in memory", output->geterror());
  };
  if (codes.size() != static_cast<size_t>(width) * static_cast<size_t>(height) * 3)
    throw FilmError("PNG in memory", "the codes are not three a pixel");
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput proxy(bytes);
  OIIO::ImageSpec spec(width, height, 3, OIIO::TypeUInt8);
  spec.attribute("oiio:ColorSpace", "sRGB");
  check(output->set_ioproxy(&proxy));
  check(output->open("memory.png", spec));
  check(output->write_image(OIIO::TypeUInt8, codes.data()));
  check(output->close());
  return {bytes.begin(), bytes.end()};
}

void write_png(const std::filesystem::path& nodes, const std::filesystem::path& png) {
  ExrReader reader(nodes);
  const PixelRect rect = reader.info().rect;
  const auto output = OIIO::ImageOutput::create("png");
  if (!output) throw FilmError(png.string(), OIIO::geterror());
  OIIO::ImageSpec spec(rect.width(), rect.height(), 3, OIIO::TypeUInt8);
  spec.attribute("oiio:ColorSpace", "sRGB");
  AtomicFile file(png);
  const auto check = [&](bool ok) {
    if (!ok) throw FilmError(png.string(), output->geterror());
  };
  check(output->open(file.path().string(), spec));
  constexpr int kRows = 64;
  std::vector<unsigned char> codes;
  for (int y = rect.y0; y < rect.y1; y += kRows) {
    const int end = std::min(rect.y1, y + kRows);
    codes.clear();
    for (const PixelStats& pixel : reader.beauty_rows(y, end))
      for (int c = 0; c < 3; ++c) codes.push_back(srgb8(pixel.mean[c]));
    check(output->write_scanlines(y - rect.y0, end - rect.y0, 0, OIIO::TypeUInt8, codes.data()));
  }
  check(output->close());
  file.commit();
}

}  // namespace woodcock
