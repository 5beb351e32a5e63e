// A picture of any program, in memory.
#pragma once

#include <filesystem>
#include <vector>

#include "renderer/core/vec.h"

namespace woodcock {

/// Linear RGB, row by row from the top left.
struct Picture {
  int width = 0, height = 0;
  std::vector<Rgb> pixels;

  const Rgb& at(int x, int y) const { return pixels[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)]; }
  /// Rec. 709, of each pixel.
  std::vector<float> luminances() const;
};

/// The R, G, B channels of the first part of an image file. Integer formats (PNG) are taken for sRGB and decoded, the others
/// for linear. Throws FilmError where it cannot be read or a value is not finite.
Picture read_picture(const std::filesystem::path& path);

/// Writes it as an 8-bit sRGB PNG, clamped to [0, 1]; the file appears whole or not at all. Throws FilmError.
void write_picture_png(const Picture& picture, const std::filesystem::path& png);

/// sRGB (IEC 61966-2-1) encoding of a linear value in [0, 1], and its inverse.
double srgb_encode(double linear);
double srgb_decode(double encoded);

/// What a screen shows: every channel clamped to [0, 1].
Picture displayed(const Picture& picture);

}  // namespace woodcock
