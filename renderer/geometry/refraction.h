// Straight paths that one smooth spherical boundary refracts: where a ray from a point inside must leave the sphere to reach a point
// outside. Knows of no scene and no path.
#pragma once

#include <array>
#include <limits>
#include <span>

#include "renderer/core/vec.h"

namespace woodcock {

struct Sphere {
  DVec3 center{0};
  double radius = 1;
};

/// One way from x inside over v on the sphere to y outside that obeys Snell's law.
struct RefractedWay {
  DVec3 v{0};          ///< on the sphere
  DVec3 wi{0}, wo{0};  ///< unit, from x to v and from v to y
  double cos_i = 1;    ///< of the angles that wi and wo make with the outward normal at v, both positive
  double cos_t = 1;
  /// dω/dA: the solid angle at x per area at y at right angles to wo. 0 where the way leaves at a grazing angle, infinite on a caustic.
  double solid_angle_per_area = 0;
};

/// All ways from one point to another: one at the most where nothing is reflected totally, else up to four.
struct RefractedWays {
  static constexpr size_t kCapacity = 4;
  std::array<RefractedWay, kCapacity> ways{};
  size_t count = 0;
  std::span<const RefractedWay> all() const& { return {ways.data(), count}; }
  void all() const&& = delete;  ///< a span must not outlive its ways
};

/// The ways from x inside of the sphere to y outside. `eta` is the index inside over that outside. Ways that are longer inside than
/// `longest` may be left out.
///
/// With the radius 1, a = |x|, b = |y| and u the angle at x between the ray and the line from the centre through x, a ray arrives on the
/// sphere around y at the angle H(u) = u − asin(a sin u) + asin(ηa sin u) − asin(ηa sin u / b) from that line; ways are the roots of
/// H = ψ and H = 2π − ψ, ψ the angle between x and y. H grows where ηa ≤ 1. Where ηa > 1, rays with sin u > 1/(ηa) do not leave; H
/// grows up to there, and beyond has one minimum at the most: dH over d sin u is a sum of four terms ±(c − sin² u)^−½ whose signs, in
/// the order of c, change once, and such a sum has no more zeros than changes of sign (Pólya & Szegő 1976, part V). Every root is
/// therefore bracketed.
///
/// The solid angle follows from dω = sin u du dφ and dA = b² sin ψ dψ dφ cos γ, γ the angle between wo and the radius at y.
RefractedWays refracted_ways(const Sphere& sphere, double eta, DVec3 x, DVec3 y, double longest = std::numeric_limits<double>::infinity());

}  // namespace woodcock
