// The lights of a scene: choosing one, sampling it from a point, evaluating what a ray meets.
//
// Everything is in render space: lengths are `scale` times world lengths, so intensities carry scale² and
// radiances carry nothing. Pdfs are per solid angle at the reference point unless a name says otherwise.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "renderer/core/vec.h"
#include "renderer/geometry/geometry.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// Light arriving at a reference point from one direction.
struct LightSample {
  Rgb radiance{0};          ///< incident radiance (delta lights: I/d², or the irradiance of a plane at right angles), NOT divided by pdf
  Vec3 wi{0};               ///< unit, from the reference point towards the light
  bool is_bounded = false;  ///< it comes from the point `p`, else from infinitely far away
  float pdf = 1;            ///< per solid angle, WITHOUT the probability of choosing this light; 1 for point, spot and distant
  /// No ray meets this light by chance, so the MIS weight of the sample is 1. True for point, spot and distant
  /// lights, and for area lights on shapes of opacity 0 (whose pdf is per solid angle all the same).
  bool delta = false;
  DVec3 p{0};                ///< where it comes from
  TargetPrimitive target{};  ///< area lights: what p lies on
  Vec3 n{0};                 ///< area lights: the geometric normal, as renderer/geometry/shape.h defines it
};

/// A point on an emitting shape met by a ray. `ng` is the unit geometric normal as renderer/geometry/shape.h
/// defines it; `uv` are the surface's texture coordinates.
struct EmitterHit {
  DVec3 p;
  Vec3 ng;
  Vec2 uv;
  uint32_t primitive;
  DVec2 parameters{0};  ///< of a patch (Hit::uv): of one that folds, the layer that was met
};

/// What a light is chosen by, of all.
enum class ChooseBy {
  kArrival,  ///< an estimate of what arrives at the point (light_selection.h)
  kPower     ///< emitted power, whatever the point; for comparison
};

/// What of a mesh is sampled at once.
enum class Pieces {
  kRectangles,  ///< rectangles as a whole, whether two triangles or a patch; else single primitives
  kTriangles    ///< single triangles, of flat patches the two halves; for comparison
};

struct LightTable;

/// All lights of a scene. Immutable and thread-safe; copies share their data.
///
/// The models are in delta_lights.h, infinite_light.h and area_light.h; the list of them is `Light` in light_table.h.
class Lights {
 public:
  /// No light at all.
  Lights();
  /// shapes[i] belongs to description.shapes[i]. `bounds` are the scene's in render space; they serve the power
  /// estimates of distant and infinite lights only. Throws SceneError for a light that cannot be built, for
  /// instance for an environment image that is not square or an area light in an object.
  Lights(const SceneDescription& description, const std::vector<Shape>& shapes, const DMat4& render_from_world, double scale, Box3 bounds);

  int size() const;

  struct Choice {
    int light;
    float pmf;  ///< the probability of this choice
  };
  /// Chooses one light for the point `ref`. u in [0,1). Nothing where no light is worth a sample: black ones, skies of constant
  /// radiance, which scattering finds without noise of its own, and lights that shine away from the point.
  std::optional<Choice> choose(double u, DVec3 ref, ChooseBy by = ChooseBy::kArrival) const;
  /// What `choose` gives for every point and every number; nothing where that depends on them.
  std::optional<Choice> only_choice(ChooseBy by = ChooseBy::kArrival) const;
  /// The probability that `choose` gives this light for `ref`.
  float pmf(int light, DVec3 ref, ChooseBy by = ChooseBy::kArrival) const;
  /// Whether `choose` gives this light for some point.
  bool is_sampled(int light) const;

  /// Samples the direction from `ref` towards a light. Nothing where no light arrives or the sample has pdf 0.
  /// `u_primitive` chooses the primitive of a mesh; `u` the point on it. A ray that leaves the scene meets all infinite lights at
  /// once, so they are one technique: whichever of them was chosen, the sample has the radiance of all, and pmf(light) × pdf is
  /// `environment_pdf`. Constant skies are never chosen.
  std::optional<LightSample> sample(int light, DVec3 ref, Vec2 u, double u_primitive, ChooseBy by = ChooseBy::kArrival,
                                    Pieces pieces = Pieces::kRectangles) const;

  /// Chooses by power, whatever the point, among the lights that stand somewhere: point, spot and area lights. Nothing where there is none.
  std::optional<Choice> choose_bounded(double u) const;
  /// The probability that `choose_bounded` gives this light; 0 for distant and infinite lights.
  float bounded_pmf(int light) const;
  /// Where a bounded light stands: the point itself, or the middle of the shape's bounds.
  DVec3 position(int light) const;

  /// The light on a shape, or kNone.
  int light_of_shape(int shape) const;
  /// Radiance that leaves `hit` in direction `wo` (unit, away from the surface).
  Rgb emitted(int light, const EmitterHit& hit, Vec3 wo) const;
  /// The pdf with which `sample(light, ref, …)` gives the direction `wi` towards `hit`.
  float pdf(int light, DVec3 ref, const EmitterHit& hit, DVec3 wi, Pieces pieces = Pieces::kRectangles) const;

  /// Radiance of a ray that leaves the scene in this direction: the sum over the infinite lights.
  Rgb environment(Vec3 direction) const;
  /// The sum over the infinite lights of pmf × pdf: the density with which choosing a light for `ref` and sampling it gives
  /// this direction. What MIS needs for a ray that left the scene.
  float environment_pdf(Vec3 direction, DVec3 ref, ChooseBy by = ChooseBy::kArrival) const;
  bool has_environment() const;

  /// Emitted power in render-space units (world power × scale²); an estimate for distant and infinite lights.
  Rgb power(int light) const;
  /// Where in the scene file the light is defined.
  const SourceLocation& where(int light) const;

  /// What of the images is not used as it stands in the files, one sentence each; for the user.
  std::vector<std::string> notes() const;

 private:
  std::shared_ptr<const LightTable> table_;
};

}  // namespace woodcock
