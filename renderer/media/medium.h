// Participating media: what lies at a point, and upper bounds of the extinction along a ray.
//
// Estimators need no more than that: a medium gives its coefficients at points of render space and a walk over
// majorant segments, and it knows nothing of tracking (after pbrt-v4's medium interface).
//
// Units: coefficients are per render unit, that is σ of the scene file divided by the scale of render space.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "renderer/media/brick_field.h"
#include "renderer/media/cloud_field.h"
#include "renderer/media/majorant_grid.h"
#include "renderer/media/phase.h"
#include "renderer/scene/description.h"

namespace woodcock {

/// The coefficients at a point, in 1/render unit.
///
/// With all four terms of the transfer equation σt = σa + σs. `--only` leaves some out (TransferTerms): σt then counts σa
/// with absorption and σs with out-scattering, so σs may exceed it.
struct MediumPoint {
  Rgb sigma_t{0};   ///< what dims a beam
  Rgb sigma_s{0};   ///< what in-scattering gains; zero where that is left out
  Rgb emission{0};  ///< σa · Le: radiance gained per render unit of length
};

/// Something with one float value at each render-space point: `at(p)`, with `map()` into its own cells.
using FloatField = std::variant<BrickField<float>, CloudField>;
inline float look_up(const FloatField& field, Vec3 p) {
  if (const auto* bricks = std::get_if<BrickField<float>>(&field)) return bricks->at(p);
  return std::get_if<CloudField>(&field)->at(p);
}

class EmissionBricks {public: struct Sample{Vec3 p; float pdf;}; std::optional<Sample> sample(Vec3,float) const {return {};} float pdf(Vec3) const {return 0;}};
/// One medium. Immutable and thread-safe; the same point gives the same bits on every thread.
class Medium {
 public:
  /// Throws `SceneError` at the medium's place when a value has no physical meaning (not finite, |g| > 0.9999, σ < 0).
  /// What was read differently than written is appended to `notes`, one sentence each. Only `terms` of the transfer equation
  /// count in what the methods say, except for bounds: these hold for σa + σs, so they bound σs as well.
  Medium(const MediumDescription& description, const DMat4& render_from_world, double scale, std::vector<std::string>& notes,
         const TransferTerms& terms = {});

  /// The same everywhere, without bounds of its own.
  bool is_homogeneous() const { return kind_ == Kind::kHomogeneous; }
  /// The coefficients of a homogeneous medium.
  const MediumPoint& homogeneous() const { return unit_; }

  /// The coefficients at a render-space point; zero outside a grid's box.
  MediumPoint at(Vec3 p) const;
  /// σt per channel at a render-space point: what shadow rays in chromatic media need.
  Rgb sigma_t(Vec3 p) const;
  /// σt at a render-space point where `is_grey()`: one float look-up.
  float grey_sigma_t(Vec3 p) const {
    if (kind_ == Kind::kGrid) return unit_.sigma_t.x * density(p);
    return sigma_t(p).x;
  }
  /// The factor of `unit()` at a render-space point: 1 in homogeneous media. Not for RGB grids, see `is_separable`.
  float density(Vec3 p) const;
  /// The coefficients at density 1; `emission` is set for homogeneous media only.
  const MediumPoint& unit() const { return unit_; }
  /// σa and σs are `density` times constants: true for all kinds but RGB grids.
  bool is_separable() const { return kind_ != Kind::kRgbGrid; }

  /// The phase function at a render-space point.
  PhaseMix phase_at(Vec3) const { return PhaseMix(phase_); }
  /// Somewhere σs > 0.
  bool scatters() const { return scatters_; }
  /// Somewhere σa · Le > 0.
  bool emits() const { return emits_; }
  /// Somewhere σt > 0. A medium that neither attenuates nor scatters nor emits is a vacuum.
  bool attenuates() const { return attenuates_; }
  /// σt is equal in all channels at every point.
  bool is_grey() const { return grey_; }
  /// One bound of σa + σs in all channels for the whole medium: the majorant of plain Woodcock tracking.
  float maximum_sigma_t() const { return maximum_sigma_t_; }
  /// Nothing at all happens in it.
  bool is_vacuum() const { return !attenuates() && !scatters() && !emits(); }
  /// Whether distances of scatterings follow from σt: it is positive wherever σs is.
  bool has_closed_forms() const {
    for (int c = 0; c < 3; ++c)
      if (unit_.sigma_s[c] > 0 && !(unit_.sigma_t[c] > 0)) return false;
    return true;
  }
  /// σt and σs are a density times constants that are equal in all channels.
  bool is_achromatic() const {
    return is_separable() && grey_ && unit_.sigma_s.x == unit_.sigma_s.y && unit_.sigma_s.y == unit_.sigma_s.z;
  }
  double mean_sigma_t() const { return is_homogeneous() ? unit_.sigma_t.x : 0.3*maximum_sigma_t_; }
  const EmissionBricks* emission_bricks() const { return nullptr; }
  /// The diagonal of the box of a medium that has bounds of its own, in render units.
  double diagonal() const { return glm::length(majorants_.box().upper - majorants_.box().lower) * majorants_.map().cell_edge(); }
  /// The bricks of a medium that is not homogeneous.
  const MajorantGrid& majorants() const { return majorants_; }

 private:
  enum class Kind { kHomogeneous, kGrid, kRgbGrid };
  /// Le = radiance × scale × scale_grid × blackbody(temperature), each factor where there is one.
  struct GridEmission {
    Rgb radiance{0};
    float scale = 0;
    std::optional<FloatField> scale_grid;
    std::optional<FloatField> temperature;
    float temperature_scale = 1, temperature_offset = 0, temperature_cutoff = 0;

    float kelvin(float value) const { return (value - temperature_offset) * temperature_scale; }
    Rgb at(Vec3 p) const;
  };
  /// σa and σs grids; an absent one is `absent` everywhere inside the box of the other.
  struct RgbGrids {
    std::optional<BrickField<Rgb>> sigma_a, sigma_s, emission;
    Rgb absent{0};
    TransferTerms terms;

    Rgb sigma_a_at(Vec3 p) const { return sigma_a ? sigma_a->at(p) : sigma_s->contains(p) ? absent : Rgb(0); }
    Rgb sigma_s_at(Vec3 p) const { return sigma_s ? sigma_s->at(p) : sigma_a->contains(p) ? absent : Rgb(0); }
    Rgb sigma_t_of(Rgb a, Rgb s) const { return (terms.absorption ? a : Rgb(0)) + (terms.out_scattering ? s : Rgb(0)); }
  };
  struct Builder;

  Kind kind_ = Kind::kHomogeneous;
  bool attenuates_ = false, scatters_ = false, emits_ = false, grey_ = true;
  float maximum_sigma_t_ = 0;
  MediumPoint unit_;
  Rgb unit_sigma_a_{0};  ///< whether absorption counts or not: emission is σa · Le
  PhaseFunction phase_;
  MajorantGrid majorants_;
  FloatField density_;
  GridEmission emission_;
  RgbGrids rgb_;
};

/// The media of a scene, by their index in `SceneDescription::media`.
class Media {
 public:
  Media() = default;
  /// Render space is scale · (world − center), as `render_from_world` says. The terms of `scene.settings` count. Throws
  /// `SceneError`.
  Media(const SceneDescription& scene, const DMat4& render_from_world, double scale);

  const Medium& operator[](int index) const { return media_[static_cast<size_t>(index)]; }
  int size() const { return static_cast<int>(media_.size()); }
  /// What was read differently than the files say; for the user.
  std::span<const std::string> notes() const { return notes_; }

 private:
  std::vector<Medium> media_;
  std::vector<std::string> notes_;
};

/// The parts of a ray where a medium may interact, front to back, each with bounds of σt. Parts in between are empty.
class MajorantWalk {
 public:
  /// `ray.d` has unit length; the walk covers [0, t_max], and t_max may be infinite.
  MajorantWalk(const Medium& medium, const Ray& ray, float t_max, bool = true) {
    if (!medium.is_homogeneous())
      bricks_ = BrickWalk(medium.majorants(), ray, t_max);
    else if (medium.maximum_sigma_t() > 0 && t_max > 0)
      whole_ = MajorantSegment{0, t_max, medium.maximum_sigma_t(), min_component(medium.homogeneous().sigma_t)};
  }
  /// The next segment, or nothing at the end.
  std::optional<MajorantSegment> next() {
    if (whole_) return std::exchange(whole_, std::nullopt);
    return bricks_.next();
  }

 private:
  std::optional<MajorantSegment> whole_;
  BrickWalk bricks_;
};

/// σs/σt per channel; 0 where there is no extinction.
Rgb albedo(const MediumPoint& point);
inline Rgb albedo(const Medium& medium, Vec3 p) { return albedo(medium.at(p)); }

inline float Medium::density(Vec3 p) const {
  if (kind_ == Kind::kHomogeneous) return 1;
  return look_up(density_, p);
}

inline Rgb Medium::sigma_t(Vec3 p) const {
  if (kind_ == Kind::kHomogeneous) return unit_.sigma_t;
  if (kind_ == Kind::kGrid) return unit_.sigma_t * density(p);
  return rgb_.sigma_t_of(rgb_.sigma_a_at(p), rgb_.sigma_s_at(p));
}

}  // namespace woodcock
