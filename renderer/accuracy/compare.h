// Two pictures, side by side.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "renderer/accuracy/error.h"
#include "renderer/accuracy/flip.h"
#include "renderer/accuracy/picture.h"

namespace woodcock {

/// How a picture x differs from a reference r. Definitions and sources: docs/accuracy.md. With ε = 0.01·mean r, the mean
/// luminance of the reference; means are over pixels and, but for `relative_mse`, channels.
struct PictureDifference {
  double mean = 0;             ///< mean luminance of the picture
  double reference_mean = 0;   ///< and of the reference
  double mse = 0;              ///< mean of (x − r)²
  double relative_mse = 0;     ///< of luminance: mean of (x − r)²/(r² + ε²), as in `ErrorEstimate`
  double mape = 0;             ///< mean of |x − r|/(|r| + ε)
  double smape = 0;            ///< mean of |x − r|/((|x| + |r|)/2 + ε), in [0, 2]
  double psnr = 0;             ///< 10·log10(peak²/mse) in dB with the reference's largest channel value as the peak; inf if equal
  std::optional<double> ssim;  ///< of what a screen shows; absent below 11 × 11 pixels
  double flip_ldr = 0;         ///< mean LDR-FLIP of what a screen shows
  double flip_hdr = 0;         ///< mean HDR-FLIP
};

/// Compares two pictures of one size. `map`, when given, receives the HDR-FLIP of every pixel.
PictureDifference compare_pictures(const Picture& picture, const Picture& reference, HdrFlip* map = nullptr);

/// Compares the R, G, B channels of two images, of any program. Throws FilmError where one cannot be read, the sizes differ,
/// or a value is not finite.
PictureDifference compare_pictures(const std::filesystem::path& picture, const std::filesystem::path& reference, HdrFlip* map = nullptr);

/// What the statistics in the node files make of the difference: is it noise? All of luminance, tested two-sided with Student's t
/// between replicates (Welch's degrees of freedom where both files have statistics).
struct NoiseTest {
  bool reference_has_noise = false;  ///< false: the reference is taken for exact
  std::string caution;               ///< why the tests may not hold; empty where nothing speaks against them
  Estimate mean_difference;          ///< picture − reference, with its 95 % interval
  double mean_z = 0;                 ///< that over its standard error
  double mean_p = 1;                 ///< how often equal expectations give one as large
  double expected_relative_mse = 0;  ///< of noise alone: mean of (Var x̄ + Var r̄)/(r² + ε²)
  /// `relative_mse` less that noise: the square of a bias, with a 95 % interval from the scatter over the pixels.
  Estimate excess_relative_mse;
  int64_t pixels = 0;
  int64_t beyond_5_percent = 0;  ///< pixels with p < 0.05; 5 % are expected
  int64_t beyond_corrected = 0;  ///< pixels with p < 0.05/pixels (Bonferroni): any is evidence
};

/// Both are pictures with their nodes beside them, node files, or pictures of other programs. Absent where the picture has no nodes or
/// holds one sample only. Throws FilmError where pixels miss samples, sizes differ, or nodes belong to another picture.
std::optional<NoiseTest> test_noise(const std::filesystem::path& picture, const std::filesystem::path& reference);

}  // namespace woodcock
