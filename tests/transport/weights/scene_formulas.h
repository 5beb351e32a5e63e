// The lights and media of a scene in double, from its description alone: probabilities, densities and values by their
// formulas. What the checker of weights compares the renderer with; nothing here calls the renderer's lights or media.
//
// Lengths are those of render space. Left out, so that generated scenes must not have them: images, textures, partial
// quadrics and transforms that shear, curved patches, instances, clouds and sparse grids, nested boundaries.
#pragma once

#include <array>
#include <numbers>
#include <optional>
#include <variant>
#include <vector>

#include "renderer/scene/description.h"
#include "renderer/world/world.h"

namespace woodcock::testing {

/// Something that can be on either side of a threshold by rounding: no weight is compared there.
struct TooNear {};

class LightFormula {
 public:
  LightFormula(const LightDescription& light, const RenderSpace& space, double scene_radius);
  LightFormula(const ShapeDescription& shape, const RenderSpace& space);

  DVec3 power() const { return power_; }
  /// The irradiance that the choice of a light expects at a point; 0 where none can arrive. Throws TooNear.
  double expected(DVec3 at) const;
  /// Point and spot lights, lights on shapes.
  bool is_bounded() const { return bounded_; }
  bool is_infinite() const { return kind_ == Kind::kInfinite; }
  /// No ray finds it by chance.
  bool is_delta() const { return delta_; }
  DVec3 position() const { return position_; }
  /// Of the surface, with either sign.
  DVec3 normal(uint32_t primitive, DVec3 p) const;

  /// Per steradian at `from`, of sampling the point p of this primitive (delta lights: 1) in the direction wi. `whole`: rectangles
  /// are sampled as such, not as two triangles. Throws TooNear.
  double pdf(DVec3 from, uint32_t primitive, DVec3 p, DVec3 wi, bool whole) const;
  /// Another part of the same shape lies between `from` and p, and lets nothing through.
  bool hides(DVec3 from, uint32_t primitive, DVec3 p) const;
  /// What arrives at `from` from the point p in direction −wi if nothing is in the way; for a light sample, that is with
  /// the opacity of what emits.
  DVec3 radiance(DVec3 from, uint32_t primitive, DVec3 p, DVec3 wi, bool sampled) const;

 private:
  enum class Kind { kPoint, kSpot, kDistant, kInfinite, kSphere, kDisk, kCylinder, kTriangles };

  /// Of one or several triangles in one plane that are sampled at once.
  double flat_pdf(const std::vector<std::array<DVec3, 3>>& piece, DVec3 from, DVec3 p) const;
  /// The triangles that are sampled together with this one: it alone, or both of a rectangle.
  std::vector<std::array<DVec3, 3>> piece(size_t triangle, bool whole) const;
  /// The box around what emits, corner by corner, in float as the renderer's.
  void include(DVec3 corner);

  /// The triangle that p was sampled from: the primitive, or the half of a patch. Throws TooNear.
  size_t triangle(uint32_t primitive, DVec3 p) const;

  Kind kind_ = Kind::kPoint;
  bool bounded_ = true, delta_ = true, two_sided_ = false, flip_ = false, patch_ = false;
  DVec3 position_{0}, power_{0}, radiance_{0}, axis_{0, 0, 1};
  double cos_full_ = 1, cos_zero_ = 1, opacity_ = 1, radius_ = 1, area_ = 0;
  DVec3 lower_{1e300}, upper_{-1e300}, facing_{0, 0, 1};
  /// All axes of emission are within the spread of facing_, all emission within the reach of its axis; radians.
  double spread_ = std::numbers::pi, reach_ = 0, intensity_ = 0;
  std::vector<std::array<DVec3, 3>> triangles_;
};

class MediumFormula {
 public:
  MediumFormula(const MediumDescription& medium, const RenderSpace& space);
  /// A sum.
  explicit MediumFormula(std::vector<MediumFormula> parts);

  bool is_homogeneous() const;
  bool scatters() const { return scatters_; }
  bool emits() const { return emits_; }
  bool samples_emission() const;
  DVec3 sigma_t(DVec3 p) const { return sigma_a(p) + sigma_s(p); }
  DVec3 sigma_s(DVec3 p) const;
  DVec3 sigma_a(DVec3 p) const;
  DVec3 emission(DVec3 p) const;  ///< σa Le
  struct Phase {
    DVec3 value;  ///< per channel
    double pdf;
  };
  /// Per steradian.
  Phase phase(DVec3 p, DVec3 wo, DVec3 wi) const;
  /// Over the box and the channels.
  double mean_sigma_t() const { return mean_; }
  /// The constant that stands for the rate of collisions.
  double typical_rate() const;
  double emitted_power() const;
  /// Per volume, of sampling p among the points that emit.
  double emission_pdf(DVec3 p) const;

 private:
  struct Grid {
    IVec3 size;
    DMat4 cell_from_render;
    double cell_volume;
    std::vector<DVec3> sigma_a, sigma_s, emission;  ///< of voxels; emission is Le
  };

  DVec3 cell(DVec3 p) const { return DVec3(grid_->cell_from_render * glm::dvec4(p, 1)); }
  double diagonal() const;
  DVec3 interpolate(const std::vector<DVec3>& voxels, DVec3 cell) const;
  DVec3 voxel(const std::vector<DVec3>& voxels, IVec3 v) const;
  void average();
  void add_voxels();

  std::optional<Grid> grid_;
  DVec3 sigma_a_{0}, sigma_s_{0}, le_{0};  ///< homogeneous
  PhaseDescription phase_;
  bool scatters_ = false, emits_ = false;
  double mean_ = 0, power_ = 0;
  std::vector<double> voxel_pdf_;
  std::vector<MediumFormula> parts_;
};

/// A closed boundary with a medium inside, apart from all others.
struct Body {
  bool sphere = true;
  DVec3 center{0}, lower{0}, upper{0};
  double radius = 0;
  int inside = kNone;
  double eta = 1;                   ///< of smooth glass around it; 1 where there is none, or where it is rough
  bool samples_refraction = false;  ///< light is sampled through it
  bool is_empty = true;             ///< roulette goes by the medium: of a box, or of a sphere with nothing else inside

  /// How far inside of the nearest part of the boundary; negative outside.
  double depth(DVec3 p) const;
  /// Where a ray is inside; empty where first >= second.
  std::pair<double, double> chord(DVec3 o, DVec3 d) const;
};

class SceneFormulas {
 public:
  SceneFormulas(const SceneDescription& scene, const World& world);

  const LightFormula& light(int i) const { return lights_[static_cast<size_t>(i)]; }
  int lights() const { return static_cast<int>(lights_.size()); }
  const MediumFormula& medium(int i) const { return media_[static_cast<size_t>(i)]; }
  const MaterialKind& material(int i) const { return scene_.materials[static_cast<size_t>(i)].kind; }
  /// Of choosing the light for a point, by what is expected there or by power. Throws TooNear.
  double pmf(int light, DVec3 at, bool by_power) const;
  double bounded_pmf(int light) const { return bounded_pmf_[static_cast<size_t>(light)]; }
  double emissive_pmf(int medium) const { return emissive_pmf_[static_cast<size_t>(medium)]; }
  DVec3 environment() const;

  /// The medium around a point, kNone for vacuum; nothing within `margin` of a boundary.
  std::optional<int> medium_at(DVec3 p, double margin) const;
  /// The body of smooth glass around a point, if light is sampled through it. Throws TooNear.
  const Body* glass_around(DVec3 p) const;
  /// Through all media along the way, and the depth in its densest channel; nothing where it is known by an estimate only.
  struct Way {
    DVec3 transmittance;
    double depth;
  };
  std::optional<Way> way(DVec3 o, DVec3 d, double length) const;

 private:
  const SceneDescription& scene_;
  std::vector<LightFormula> lights_;
  std::vector<MediumFormula> media_;
  std::vector<Body> bodies_;
  std::vector<double> pmf_, bounded_pmf_, emissive_pmf_;
  int around_ = kNone;
};

}  // namespace woodcock::testing
