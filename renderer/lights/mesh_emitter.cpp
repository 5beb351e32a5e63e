#include <algorithm>

#include "renderer/geometry/patch.h"
#include "renderer/lights/emitter.h"
#include "renderer/lights/patch_geometry.h"
#include "renderer/lights/triangle_sampling.h"

namespace woodcock {
namespace {

double triangle_area(const std::array<DVec3, 3>& c) { return 0.5 * glm::length(glm::cross(c[1] - c[0], c[2] - c[0])); }

DVec3 interpolate(const std::array<DVec3, 3>& c, DVec2 b) { return (1 - b.x - b.y) * c[0] + b.x * c[1] + b.y * c[2]; }

/// The two triangles of a flat patch, cut along the diagonal from (0,0) to (1,1).
std::array<DVec3, 3> half(const PatchCorners& c, int which) {
  return which == 0 ? std::array<DVec3, 3>{c[0], c[1], c[3]} : std::array<DVec3, 3>{c[0], c[3], c[2]};
}

}  // namespace

struct MeshEmitter::Point {
  uint32_t primitive = 0;
  DVec2 at{0};  // of a triangle: barycentric coordinates of its second and third corner; of a patch: (u,v)
  DVec3 p{0};
  DVec3 normal{0};  // of any length, on the primitive's own side
  DVec3 ng{0};      // unit, on the side that the file means, where that is known before the vertex normals are; else zero
  double pdf = 0;   // per solid angle at the reference point, of the primitive or piece alone
};

MeshEmitter::MeshEmitter(const Shape& shape, bool equal_weights) : flip_(shape.flip) {
  if (const Mesh* mesh = std::get_if<Mesh>(&shape.geometry)) {
    positions_ = mesh->positions;
    normals_ = mesh->normals;
    uv_ = mesh->uv;
    triangles_ = mesh->triangles;
  } else {
    const PatchMesh& patches = std::get<PatchMesh>(shape.geometry);
    positions_ = patches.positions;
    normals_ = patches.normals;
    uv_ = patches.uv;
    patches_ = patches.patches;
  }
  for (size_t i = 0; i < triangles_.size(); ++i) areas_.push_back(triangle_area(triangle(i)));
  for (size_t i = 0; i < patches_.size(); ++i) {
    const PatchCorners c = patch(i);
    flat_.push_back(is_flat_and_convex(c));
    const double first = triangle_area(half(c, 0));
    areas_.push_back(is_flat(i) ? first + triangle_area(half(c, 1)) : patch_area(c));
    first_half_.push_back(is_flat(i) ? first / areas_[i] : 0);
  }
  std::vector<double> weights;
  for (double& area : areas_) {
    // What has no area has no normal either.
    if (!(area > 0) || !std::isfinite(area)) area = 0;
    weights.push_back(equal_weights && area > 0 ? 1.0 : area);
  }
  choice_ = DiscreteDistribution(weights);
  find_pieces(weights);
}

void MeshEmitter::find_pieces(const std::vector<double>& weights) {
  std::vector<double> piece_weights;
  for (uint32_t i = 0; i < areas_.size(); ++i) {
    Piece piece{{i, i}, {0, 0}};
    double weight = weights[i];
    if (const auto rectangle = weight > 0 ? rectangle_from(piece) : std::nullopt) {
      piece.rectangle = static_cast<int>(rectangles_.size());
      rectangles_.push_back(*rectangle);
      if (normals_.empty()) piece.normal = orient(rectangle->n, DVec3(0));
      if (piece.primitive[1] != i) {
        for (size_t k = 0; k < 2; ++k) {
          const std::array<DVec3, 3> c = triangle(piece.primitive[k]);
          const size_t first = piece.turn[k];
          piece.halves[k] = {c[first], c[(first + 1) % 3] - c[first], c[(first + 2) % 3] - c[first]};
        }
        piece_of_.push_back(static_cast<uint32_t>(pieces_.size()));
        weight += weights[++i];
      }
    }
    piece_of_.push_back(static_cast<uint32_t>(pieces_.size()));
    pieces_.push_back(piece);
    piece_weights.push_back(weight);
  }
  if (rectangles_.empty()) {
    pieces_ = {};
    piece_of_ = {};
    return;
  }
  piece_choice_ = DiscreteDistribution(piece_weights);
}

std::optional<Rectangle> MeshEmitter::rectangle_from(Piece& piece) const {
  const size_t i = piece.primitive[0];
  if (patches_.size() > i) {
    const PatchCorners c = patch(i);
    return is_flat(i) ? make_rectangle(c[0], c[1], c[2], c[3]) : std::nullopt;
  }
  if (i + 1 >= triangles_.size() || !(areas_[i + 1] > 0)) return std::nullopt;
  // Equal windings run along the diagonal in opposite directions. Which of the three edges of each is the diagonal is tried.
  const std::array<DVec3, 3> a = triangle(i), b = triangle(i + 1);
  for (uint8_t k = 0; k < 3; ++k)
    for (uint8_t m = 0; m < 3; ++m) {
      if (a[(k + 1) % 3] != b[(m + 2) % 3] || a[(k + 2) % 3] != b[(m + 1) % 3]) continue;
      const auto rectangle = make_rectangle(a[k], a[(k + 1) % 3], a[(k + 2) % 3], b[m]);
      if (!rectangle) continue;
      piece.primitive[1] = static_cast<uint32_t>(i + 1);
      piece.turn = {k, m};
      return rectangle;
    }
  return std::nullopt;
}

std::array<DVec3, 3> MeshEmitter::triangle(size_t i) const {
  return {vertex(triangles_[i][0]), vertex(triangles_[i][1]), vertex(triangles_[i][2])};
}

PatchCorners MeshEmitter::patch(size_t i) const {
  return {vertex(patches_[i][0]), vertex(patches_[i][1]), vertex(patches_[i][2]), vertex(patches_[i][3])};
}

DVec3 MeshEmitter::orient(DVec3 normal, DVec3 shading) const {
  if (flip_) normal = -normal;
  return glm::normalize(glm::dot(normal, shading) < 0 ? -normal : normal);
}

DirectionCone MeshEmitter::normals() const {
  std::vector<DVec3> all;
  DVec3 sum(0);
  for (size_t i = 0; i < areas_.size(); ++i) {
    if (!(areas_[i] > 0)) continue;
    if (!patches_.empty() && !is_flat(i)) return {};
    DVec3 normal(0);
    if (patches_.empty()) {
      const std::array<DVec3, 3> c = triangle(i);
      normal = glm::cross(c[1] - c[0], c[2] - c[0]);
    } else {
      normal = patch_normal(patch(i), {0.5, 0.5});
    }
    DVec3 n = orient(normal, DVec3(0));
    if (!normals_.empty()) {
      // Vertex normals that disagree about the side leave it to the point.
      int same = 0, other = 0;
      const auto count = [&](uint32_t v) { (glm::dot(DVec3(normals_[v]), n) > 0 ? same : other) += 1; };
      if (patches_.empty()) {
        for (const uint32_t v : triangles_[i]) count(v);
      } else {
        for (const uint32_t v : patches_[i]) count(v);
      }
      if (same > 0 && other > 0) return {};
      if (other > 0) n = -n;
    }
    all.push_back(n);
    sum += areas_[i] * n;
  }
  const double length = glm::length(sum);
  if (!(length > 0) || !std::isfinite(length)) return {};
  DirectionCone cone{sum / length, 1};
  for (const DVec3 n : all) cone.cos_angle = std::min(cone.cos_angle, glm::dot(n, cone.axis));
  return cone.cos_angle > 0 ? cone : DirectionCone{};
}

bool MeshEmitter::sample_primitive(size_t i, DVec3 ref, DVec2 u, double u_half, Point& point) const {
  point.primitive = static_cast<uint32_t>(i);
  if (patches_.empty()) {
    const std::array<DVec3, 3> corner = triangle(i);
    const auto found = sample_triangle(corner, ref, u);
    if (!found) return false;
    point.at = found->barycentric;
    point.p = interpolate(corner, point.at);
    point.normal = glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
    point.pdf = found->pdf;
    return true;
  }
  const PatchCorners corner = patch(i);
  if (!is_flat(i)) {
    point.at = u;
    point.p = patch_point(corner, u);
    point.normal = patch_normal(corner, u);
    point.pdf = patch_uv_pdf(corner, u, ref, point.p);
    return true;
  }
  const double first = first_half_[i];
  const int which = u_half < first ? 0 : 1;
  const std::array<DVec3, 3> c = half(corner, which);
  const auto found = sample_triangle(c, ref, u);
  if (!found) return false;
  point.p = interpolate(c, found->barycentric);
  const DVec2 b = found->barycentric;
  if (is_parallelogram(corner)) {
    point.at = which == 0 ? DVec2(b.x + b.y, b.y) : DVec2(b.x, b.x + b.y);
  } else {
    // Flat but for the rounding of its corners: the point is put back on the surface.
    point.at = invert_patch(corner, point.p);
    point.p = patch_point(corner, point.at);
  }
  point.normal = patch_normal(corner, point.at);
  point.pdf = (which == 0 ? first : 1 - first) * found->pdf;
  return true;
}

bool MeshEmitter::sample_piece(const Piece& piece, DVec3 ref, DVec2 u, double u_half, Point& point) const {
  if (piece.rectangle < 0) return sample_primitive(piece.primitive[0], ref, u, u_half, point);
  const Rectangle& rectangle = rectangles_[static_cast<size_t>(piece.rectangle)];
  const bool two = piece.primitive[0] != piece.primitive[1];
  if (!stands_for_surface(rectangle, ref)) {
    if (!two) return sample_primitive(piece.primitive[0], ref, u, u_half, point);
    const bool found = sample_primitive(piece.primitive[u_half < 0.5 ? 0 : 1], ref, u, 0, point);
    point.pdf /= 2;
    return found;
  }
  const auto found = sample_rectangle(rectangle, ref, u);
  if (!found) return false;
  point = {piece.primitive[0], found->uv, DVec3(0), rectangle.n, piece.normal, found->pdf};
  if (!two) {
    point.p = patch_point(patch(point.primitive), point.at);
    return true;
  }
  const size_t which = point.at.x + point.at.y < 1 ? 0 : 1;
  const DVec2 along = which == 0 ? point.at : DVec2(1) - point.at;
  const Piece::Half& part = piece.halves[which];
  const double rest = 1 - along.x - along.y;
  point.primitive = piece.primitive[which];
  // The weights of the second and third corner, while rest, along.x and along.y belong to the corners from `turn` on.
  const uint8_t turn = piece.turn[which];
  point.at = turn == 0 ? along : turn == 1 ? DVec2(rest, along.x) : DVec2(along.y, rest);
  point.p = part.corner + along.x * part.s + along.y * part.t;
  return true;
}

std::optional<EmitterSample> MeshEmitter::sample(DVec3 ref, DVec2 u, double u_primitive, Pieces pieces) const {
  if (!(choice_.total() > 0)) return std::nullopt;
  const bool whole = pieces == Pieces::kRectangles && !pieces_.empty();
  const DiscreteDistribution& choices = whole ? piece_choice_ : choice_;
  const bool is_only = choices.size() == 1;
  const auto choice = is_only ? DiscreteDistribution::Sample{0, u_primitive} : choices.sample(u_primitive);
  Point point;
  const bool found = whole ? sample_piece(pieces_[choice.index], ref, u, choice.remainder, point)
                           : sample_primitive(choice.index, ref, u, choice.remainder, point);
  if (!found) return std::nullopt;
  EmitterSample sample;
  sample.pdf = is_only ? point.pdf : choices.probability(choice.index) * point.pdf;
  sample.p = point.p;
  sample.primitive = point.primitive;
  const DVec3 to_light = sample.p - ref;
  sample.distance = glm::length(to_light);
  if (!(sample.pdf > 0) || !std::isfinite(sample.pdf) || !(sample.distance > 0) || !(glm::dot(point.normal, point.normal) > 0))
    return std::nullopt;
  sample.wi = to_light / sample.distance;
  sample.along = glm::dot(point.normal, sample.wi) > 0;
  DVec3 shading(0);
  const Vec2 t(point.at);
  const auto blend = [&](const auto& values) {
    if (patches_.empty()) {
      const auto& v = triangles_[point.primitive];
      return static_cast<float>(1 - point.at.x - point.at.y) * values[v[0]] + t.x * values[v[1]] + t.y * values[v[2]];
    }
    const auto& v = patches_[point.primitive];
    return (1 - t.y) * ((1 - t.x) * values[v[0]] + t.x * values[v[1]]) + t.y * ((1 - t.x) * values[v[2]] + t.x * values[v[3]]);
  };
  if (!normals_.empty()) shading = DVec3(blend(normals_));
  sample.uv = !uv_.empty() ? blend(uv_) : patches_.empty() ? Vec2(t.x + t.y, t.y) : t;
  sample.ng = point.ng == DVec3(0) ? orient(point.normal, shading) : point.ng;
  return sample;
}

double MeshEmitter::primitive_pdf(size_t i, DVec3 ref, const EmitterHit& hit) const {
  const DVec3 p(hit.p);
  if (patches_.empty()) return triangle_pdf(triangle(i), ref, p);
  const PatchCorners corner = patch(i);
  if (!is_flat(i)) return patch_uv_pdf(corner, hit.parameters, ref, p);
  // Which side of the diagonal the point lies on says which triangle it was sampled from.
  const DVec3 normal = patch_normal(corner, {0.5, 0.5});
  const int which = glm::dot(glm::cross(corner[3] - corner[0], p - corner[0]), normal) < 0 ? 0 : 1;
  const double first = first_half_[i];
  return (which == 0 ? first : 1 - first) * triangle_pdf(half(corner, which), ref, p);
}

double MeshEmitter::pdf(DVec3 ref, const EmitterHit& hit, DVec3 /*wi*/, Pieces pieces) const {
  const size_t i = hit.primitive;
  double probability = choice_.probability(i);
  if (!(probability > 0)) return 0;
  double pdf = 0;
  if (pieces == Pieces::kRectangles && !pieces_.empty()) {
    const Piece& piece = pieces_[piece_of_[i]];
    probability = piece_choice_.probability(piece_of_[i]);
    if (piece.rectangle < 0) {
      pdf = primitive_pdf(i, ref, hit);
    } else if (const Rectangle& rectangle = rectangles_[static_cast<size_t>(piece.rectangle)]; stands_for_surface(rectangle, ref)) {
      pdf = rectangle_pdf(rectangle, ref, hit.p);
    } else {
      pdf = primitive_pdf(i, ref, hit) / (piece.primitive[0] != piece.primitive[1] ? 2 : 1);
    }
  } else {
    pdf = primitive_pdf(i, ref, hit);
  }
  return std::isfinite(pdf) ? probability * pdf : 0;
}

}  // namespace woodcock
