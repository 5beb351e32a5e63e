// Images as linear RGB floats: textures, environment maps, and images on area lights.
#pragma once

#include <string>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// The value of an image outside [0, 1]².
enum class ImageWrap {
  kRepeat,
  kBlack,
  kClamp,
  kOctahedralSphere,  ///< the equal-area octahedral map of a sphere: an edge continues on its mirror image
};

/// Row-major, the top row of the picture first. Every value is finite. Immutable once loaded.
struct Image {
  int width = 0, height = 0;
  std::vector<Rgb> pixels;   ///< linear; a grey file repeats its value in the three channels
  std::vector<float> alpha;  ///< of RGBA files only: one a pixel, or empty where it is 1 everywhere
  std::string file;          ///< its name without the folder, for messages
  /// Pixels with a negative channel, which is read as 0, and the smallest value.
  size_t negative_pixels = 0;
  float smallest = 0;
  /// The file has alpha beside a single grey channel: pbrt-v4 does not read it, and it is not read here.
  bool has_unread_alpha = false;

  Rgb at(int x, int y) const { return pixels[static_cast<size_t>(y) * static_cast<size_t>(width) + static_cast<size_t>(x)]; }

  /// What a float texture or an opacity map reads: alpha where there is one, else the mean of the channels.
  float scalar_at(int x, int y) const;

  /// Bilinear interpolation between pixel centres at st, (0, 0) being the outer corner of the first pixel of
  /// the top row. Coordinates beyond 1e9 pixels have no fraction left in float and read as 0.
  Rgb bilinear(Vec2 st, ImageWrap wrap) const;
  float bilinear_scalar(Vec2 st, ImageWrap wrap) const;
  /// The pixel that contains st.
  Rgb nearest(Vec2 st, ImageWrap wrap) const;
  float nearest_scalar(Vec2 st, ImageWrap wrap) const;

  /// A sentence about the negative pixels, empty where there are none.
  std::string note_on_negatives() const;
};

/// Reads `path` through OpenImageIO (PNG, JPEG, EXR, HDR, TIFF, …).
///
/// `encoding` says how integer-coded values become linear ones: "" or "sRGB", "linear", or "gamma <g>" for
/// v^g; floating-point files are linear whatever it says, as in pbrt-v4. Alpha is read from RGBA files only, as in pbrt-v4. Throws
/// SceneError at `where` for a file that cannot be read, has no colour channels, is larger than 16384 pixels a side or 1 GiB, or holds a
/// value that is not finite.
Image load_image(const std::string& path, const std::string& encoding, const SourceLocation& where);

}  // namespace woodcock
