#include "renderer/accuracy/compare.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "renderer/accuracy/ssim.h"
#include "renderer/film/tile.h"

namespace woodcock {

namespace {

double mean_luminance(const Picture& picture) {
  double sum = 0;
  for (const Rgb& pixel : picture.pixels) sum += static_cast<double>(luminance(pixel));
  return sum / static_cast<double>(picture.pixels.size());
}

}  // namespace

PictureDifference compare_pictures(const Picture& picture, const Picture& reference, HdrFlip* map) {
  PictureDifference difference;
  difference.mean = mean_luminance(picture);
  difference.reference_mean = mean_luminance(reference);
  const double floor = 0.01 * std::abs(difference.reference_mean), pixels = static_cast<double>(reference.pixels.size());
  double squares = 0, relative = 0, absolute = 0, symmetric = 0, peak = 0;
  for (size_t i = 0; i < reference.pixels.size(); ++i) {
    const Rgb x = picture.pixels[i], r = reference.pixels[i];
    for (int c = 0; c < 3; ++c) {
      const double xc = static_cast<double>(x[c]), rc = static_cast<double>(r[c]), d = std::abs(xc - rc);
      squares += d * d;
      // Only a black reference makes these scales zero; any difference from it is then infinitely large.
      if (d != 0) absolute += d / (std::abs(rc) + floor);
      if (d != 0) symmetric += d / (0.5 * (std::abs(xc) + std::abs(rc)) + floor);
      peak = std::max(peak, rc);
    }
    const double lr = static_cast<double>(luminance(r)), d = static_cast<double>(luminance(x)) - lr;
    if (d != 0) relative += d * d / (lr * lr + floor * floor);
  }
  difference.mse = squares / (3 * pixels);
  difference.relative_mse = relative / pixels;
  difference.mape = absolute / (3 * pixels);
  difference.smape = symmetric / (3 * pixels);
  difference.psnr = difference.mse > 0 ? 10 * std::log10(peak * peak / difference.mse) : std::numeric_limits<double>::infinity();
  difference.ssim = ssim(reference, picture);
  difference.flip_ldr = mean_of(flip_ldr(displayed(reference), displayed(picture)));
  HdrFlip hdr = flip_hdr(reference, picture);
  difference.flip_hdr = mean_of(hdr.map);
  if (map) *map = std::move(hdr);
  return difference;
}

PictureDifference compare_pictures(const std::filesystem::path& picture_path, const std::filesystem::path& reference_path, HdrFlip* map) {
  const Picture picture = read_picture(picture_path), reference = read_picture(reference_path);
  if (picture.width != reference.width || picture.height != reference.height)
    throw FilmError(picture_path.string(), fmt::format("is {}x{} pixels, the reference {} {}x{}", picture.width, picture.height,
                                                       reference_path.string(), reference.width, reference.height));
  return compare_pictures(picture, reference, map);
}

}  // namespace woodcock
