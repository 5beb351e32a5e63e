// Emitting shapes as sampling techniques: a point on the shape from a reference point, and the pdf of doing so.
//
// All geometry is in double and in render space; vertices in float are exact there. Techniques and pdfs are
// functions of the reference point and the primitive only, so that `sample` and `pdf` always speak of the same one.
#pragma once

#include <optional>
#include <vector>

#include "renderer/core/distribution.h"
#include "renderer/geometry/shape.h"
#include "renderer/lights/direction_map.h"
#include "renderer/lights/light.h"
#include "renderer/lights/light_bounds.h"
#include "renderer/lights/patch_geometry.h"
#include "renderer/lights/rectangle_sampling.h"

namespace woodcock {

/// A point on an emitting shape, seen from a reference point.
struct EmitterSample {
  DVec3 p;          ///< on the shape
  DVec3 ng;         ///< unit geometric normal, as renderer/geometry/shape.h defines it
  DVec3 wi;         ///< unit, from the reference point to p
  double distance;  ///< from the reference point to p
  double pdf;       ///< per solid angle at the reference point
  Vec2 uv;          ///< texture coordinates
  uint32_t primitive;
  bool along = false;  ///< wi leaves towards the side of the shape's own normal (TargetPrimitive)
};

/// Triangles and bilinear patches. A primitive is chosen by its weight, then a point on it: triangles and flat
/// patches by area where they look small and by solid angle where they look large, other patches uniformly in (u,v).
/// Primitives without area are never chosen. A rectangle, given as a patch or as two triangles in a row, is one piece: it is chosen as a
/// whole and sampled by area or by solid angle.
class MeshEmitter {
 public:
  /// `equal_weights`: choose primitives alike instead of by area.
  MeshEmitter(const Shape& shape, bool equal_weights);

  std::optional<EmitterSample> sample(DVec3 ref, DVec2 u, double u_primitive, Pieces pieces) const;
  double pdf(DVec3 ref, const EmitterHit& hit, DVec3 wi, Pieces pieces) const;
  size_t primitives() const { return areas_.size(); }
  double area(size_t primitive) const { return areas_[primitive]; }
  /// Holds all geometric normals.
  DirectionCone normals() const;

 private:
  /// What is chosen at once: a primitive, or the two triangles of a rectangle. For s + t < 1 the first one's corners from `turn[0]` on have
  /// the weights (1 − s − t, s, t); beyond the diagonal the second one's from `turn[1]` on have (s + t − 1, 1 − s, 1 − t).
  struct Piece {
    std::array<uint32_t, 2> primitive;  // equal where there is one
    std::array<uint8_t, 2> turn;
    int rectangle = -1;  // index in `rectangles_`
    // Of two triangles: the corner of each that has the first weight, and its edges to the others.
    struct Half {
      DVec3 corner{0}, s{0}, t{0};
    };
    std::array<Half, 2> halves{};
    DVec3 normal{0};  // of a rectangle, unit, on the side that the file means; zero where vertex normals have a say
  };
  struct Point;  // of a primitive

  /// `weights` per primitive, 0 for those never chosen.
  void find_pieces(const std::vector<double>& weights);
  /// The rectangle that starts with the piece's primitive; fills in the piece.
  std::optional<Rectangle> rectangle_from(Piece& piece) const;
  /// Fills in the point; false where there is none.
  bool sample_piece(const Piece& piece, DVec3 ref, DVec2 u, double u_half, Point& point) const;
  bool sample_primitive(size_t i, DVec3 ref, DVec2 u, double u_half, Point& point) const;
  double primitive_pdf(size_t i, DVec3 ref, const EmitterHit& hit) const;
  std::array<DVec3, 3> triangle(size_t i) const;
  PatchCorners patch(size_t i) const;
  /// `normal` (of any length) as a unit vector on the side that the file means; `shading` is 0 without vertex normals.
  DVec3 orient(DVec3 normal, DVec3 shading) const;
  DVec3 vertex(uint32_t index) const { return positions_[index]; }
  bool is_flat(size_t primitive) const { return flat_[primitive] != 0; }

  std::vector<DVec3> positions_;
  std::vector<Vec3> normals_;
  std::vector<Vec2> uv_;
  std::vector<std::array<uint32_t, 3>> triangles_;
  std::vector<std::array<uint32_t, 4>> patches_;  // one of the two is empty
  bool flip_;
  std::vector<double> areas_;
  std::vector<char> flat_;          // per patch: two triangles stand for it
  std::vector<double> first_half_;  // per flat patch: the first one's share of its area, else 0
  DiscreteDistribution choice_;     // of a primitive
  // Empty where there is no rectangle.
  std::vector<Piece> pieces_;
  std::vector<Rectangle> rectangles_;
  std::vector<uint32_t> piece_of_;     // per primitive
  DiscreteDistribution piece_choice_;  // of a piece
};

/// Spheres, disks and cylinders. A full sphere, however its transform stretches it, is sampled in its own space:
/// by solid angle from outside, uniformly in direction from inside. Everything else is sampled by area.
class QuadricEmitter {
 public:
  explicit QuadricEmitter(const Shape& shape);

  std::optional<EmitterSample> sample(DVec3 ref, DVec2 u, double u_primitive, Pieces) const;
  double pdf(DVec3 ref, const EmitterHit& hit, DVec3 wi, Pieces) const;
  size_t primitives() const { return 1; }
  double area(size_t) const { return area_; }
  /// Holds all geometric normals; exact for a disk only.
  DirectionCone normals() const;

 private:
  DVec3 object_normal(DVec3 p) const;
  Vec2 texture_coordinates(DVec3 p) const;
  DVec3 point(DVec2 u) const;  // uniform by object-space area
  double area_ratio(DVec3 p) const;
  /// The pdf of a direction towards a full sphere, whose centre is d away in object space.
  double sphere_pdf(double d, DVec3 wi) const;
  EmitterSample finish(DVec3 p_object, DVec3 ref) const;

  Quadric quadric_;
  bool flip_;
  bool full_sphere_;
  DirectionMap directions_;  // a: render space, b: object space
  glm::dmat3 cofactor_;      // takes object-space area vectors to render space
  double object_area_ = 0, area_ = 0;
};

}  // namespace woodcock
