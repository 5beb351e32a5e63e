// Sampling one rectangle from a reference point.
#pragma once

#include <optional>

#include "renderer/core/vec.h"

namespace woodcock {

/// corner + s · x + t · y for s in [0, width] and t in [0, height].
struct Rectangle {
  DVec3 corner;
  DVec3 x, y, n;  ///< unit and at right angles to each other; n = x × y
  double width, height;
  double error;  ///< distance of the real corners from these at most: a file gives them with few digits
};

/// Nothing where the corners in the order 00, 10, 01, 11 are not those of a rectangle, to within a millionth of its size.
std::optional<Rectangle> make_rectangle(DVec3 p00, DVec3 p10, DVec3 p01, DVec3 p11);

struct RectangleSample {
  DVec2 uv;    ///< in [0,1]²: (s / width, t / height)
  double pdf;  ///< per solid angle at the reference point
};

/// Whether the rectangle stands for the surface it was made of: not where the reference point is so close to its plane that the error of
/// the corners turns the surface by more than a thousandth.
bool stands_for_surface(const Rectangle& rectangle, DVec3 ref);

/// A point on the rectangle: uniform by area where every part of it is about equally far away, uniform by solid angle where it looks large
/// (Ureña, Fajardo & King 2013, "An Area-Preserving Parametrization for Spherical Rectangles"). Nothing where the reference point lies in
/// its plane.
std::optional<RectangleSample> sample_rectangle(const Rectangle& rectangle, DVec3 ref, DVec2 u);

/// The pdf with which `sample_rectangle` gives the point `p` of the rectangle, per solid angle; 0 where it gives none.
double rectangle_pdf(const Rectangle& rectangle, DVec3 ref, DVec3 p);

}  // namespace woodcock
