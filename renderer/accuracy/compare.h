// Two pictures, side by side.
#pragma once

#include <filesystem>

namespace woodcock {

/// How a picture differs from a reference. `relative_mse` is of luminance, over the reference's own values:
/// mean of (x − r)²/(r² + (0.01·mean r)²), as in `ErrorEstimate`.
struct PictureDifference {
  double mean = 0;            ///< mean luminance of the picture
  double reference_mean = 0;  ///< and of the reference
  double mse = 0;             ///< mean over pixels and channels of (x − r)²
  double relative_mse = 0;
  double psnr = 0;  ///< 10·log10(peak²/mse) in dB with the reference's largest channel value as the peak; inf if equal
};

/// Compares the R, G, B channels of two images, of any program. Throws FilmError where one cannot be read, the
/// sizes differ, or a value is not finite.
PictureDifference compare_pictures(const std::filesystem::path& picture, const std::filesystem::path& reference);

}  // namespace woodcock
