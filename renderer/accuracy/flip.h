// FLIP: how visible the difference is when one flips between two pictures.
//
// LDR: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström & Fairchild 2020, "FLIP: A Difference Evaluator for Alternating
// Images". Both pictures are filtered by the contrast sensitivity of the eye, compared as colours by the HyAB distance of
// Hunt-adjusted L*a*b*, and where edges or points differ the colour difference is raised.
// HDR: Andersson, Nilsson, Shirley & Akenine-Möller 2021, "Visualizing Errors in Rendered High Dynamic Range Images": the largest
// LDR-FLIP over exposures between those that show the brightest and the median luminance of the reference.
#pragma once

#include "renderer/accuracy/filter.h"
#include "renderer/accuracy/picture.h"

namespace woodcock {

/// Pixels per degree of visual angle of a 0.7 m wide screen of 3840 pixels at 0.7 m, the papers' default: about 67.
inline constexpr double kPixelsPerDegree = 3840 * 3.14159265358979323846 / 180;

/// LDR-FLIP, in [0, 1] for every pixel, of linear RGB in [0, 1]. The pictures must be of one size.
Plane flip_ldr(const Picture& reference, const Picture& test, double pixels_per_degree = kPixelsPerDegree);

/// A map, and the exposures it is over: `count` of them, evenly from `start` to `stop`, as powers of two.
struct HdrFlip {
  Plane map;
  double start = 0, stop = 0;
  int count = 0;
};

/// HDR-FLIP of linear RGB; negative values count as zero. Where the reference's median is zero the median of its pixels above
/// zero is taken; a black reference is shown at exposure 0.
HdrFlip flip_hdr(const Picture& reference, const Picture& test, double pixels_per_degree = kPixelsPerDegree);

double mean_of(const Plane& plane);

/// The colour of an error in [0, 1]: from black over blue, red and yellow to white with L* growing evenly from 0 to 97, so that
/// equal steps look equal, in grey as well. Linear RGB.
Rgb error_colour(double error);

/// `error_colour` of every pixel.
Picture error_picture(const Plane& map);

}  // namespace woodcock
