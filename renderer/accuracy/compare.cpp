#include "renderer/accuracy/compare.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/film/tile.h"

namespace woodcock {

namespace {

struct Picture {
  int width = 0, height = 0;
  std::vector<Rgb> pixels;
};

/// The R, G, B channels of the first part.
Picture read_rgb(const std::filesystem::path& path) {
  const auto refuse = [&](std::string_view reason) { throw FilmError(path.string(), reason); };
  const auto input = OIIO::ImageInput::open(path.string());
  if (!input) refuse(fmt::format("cannot be read: {}", OIIO::geterror()));
  const OIIO::ImageSpec spec = input->spec();
  constexpr int64_t kMaxPixels = int64_t{1} << 28;
  if (spec.width < 1 || spec.height < 1 || spec.nchannels > 1024 || int64_t{spec.width} * spec.height > kMaxPixels)
    refuse("its size is beyond what is read");
  int channel[3];
  for (int c = 0; c < 3; ++c) {
    channel[c] = spec.channelindex(std::string(1, "RGB"[c]));
    if (channel[c] < 0) refuse(fmt::format("it has no channel {}", "RGB"[c]));
  }
  Picture picture{spec.width, spec.height, {}};
  picture.pixels.resize(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.height));
  std::vector<float> row(static_cast<size_t>(spec.width) * static_cast<size_t>(spec.nchannels));
  for (int y = 0; y < spec.height; ++y) {
    if (!input->read_scanlines(0, 0, spec.y + y, spec.y + y + 1, 0, 0, spec.nchannels, OIIO::TypeFloat, row.data()))
      refuse(fmt::format("row {} cannot be read: {}", y, input->geterror()));
    for (int x = 0; x < spec.width; ++x) {
      const float* in = row.data() + static_cast<size_t>(x) * static_cast<size_t>(spec.nchannels);
      const Rgb value{in[channel[0]], in[channel[1]], in[channel[2]]};
      if (!is_finite(value)) refuse(fmt::format("pixel ({}, {}) is not finite", x, y));
      picture.pixels[static_cast<size_t>(y) * static_cast<size_t>(spec.width) + static_cast<size_t>(x)] = value;
    }
  }
  return picture;
}

double mean_luminance(const Picture& picture) {
  double sum = 0;
  for (const Rgb& pixel : picture.pixels) sum += static_cast<double>(luminance(pixel));
  return sum / static_cast<double>(picture.pixels.size());
}

}  // namespace

PictureDifference compare_pictures(const std::filesystem::path& picture_path, const std::filesystem::path& reference_path) {
  const Picture picture = read_rgb(picture_path), reference = read_rgb(reference_path);
  if (picture.width != reference.width || picture.height != reference.height)
    throw FilmError(picture_path.string(), fmt::format("is {}x{} pixels, the reference {} {}x{}", picture.width, picture.height,
                                                       reference_path.string(), reference.width, reference.height));
  PictureDifference difference;
  difference.mean = mean_luminance(picture);
  difference.reference_mean = mean_luminance(reference);
  const double floor = 0.01 * difference.reference_mean, pixels = static_cast<double>(reference.pixels.size());
  double squares = 0, relative = 0, peak = 0;
  for (size_t i = 0; i < reference.pixels.size(); ++i) {
    const Rgb x = picture.pixels[i], r = reference.pixels[i];
    for (int c = 0; c < 3; ++c) {
      const double d = static_cast<double>(x[c]) - static_cast<double>(r[c]);
      squares += d * d;
      peak = std::max(peak, static_cast<double>(r[c]));
    }
    const double lr = static_cast<double>(luminance(r)), d = static_cast<double>(luminance(x)) - lr, scale = lr * lr + floor * floor;
    // Only a black reference makes the scale zero; any difference from it is then infinitely large.
    if (d != 0) relative += d * d / scale;
  }
  difference.mse = squares / (3 * pixels);
  difference.relative_mse = relative / pixels;
  difference.psnr = difference.mse > 0 ? 10 * std::log10(peak * peak / difference.mse) : std::numeric_limits<double>::infinity();
  return difference;
}

}  // namespace woodcock
