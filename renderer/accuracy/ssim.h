// Structural similarity.
#pragma once

#include <optional>

#include "renderer/accuracy/filter.h"
#include "renderer/accuracy/picture.h"

namespace woodcock {

/// Mean structural similarity of two planes of equal size with values of range 1 (Wang, Bovik, Sheikh & Simoncelli 2004, "Image
/// Quality Assessment: From Error Visibility to Structural Similarity", eq. 13 and 17): windows of 11 × 11 pixels with
/// Gaussian weights of deviation 1.5, K1 = 0.01, K2 = 0.03, over all windows inside the image. 1 for equal planes. Absent
/// where an image is smaller than a window.
std::optional<double> ssim(const Plane& a, const Plane& b);

/// The same of what a screen shows: the Rec. 709 luminance of the sRGB-encoded, clamped channels.
std::optional<double> ssim(const Picture& a, const Picture& b);

}  // namespace woodcock
