// Participating media: what lies at a point, and upper bounds of the extinction along a ray.
//
// Estimators need no more than that: a medium gives its coefficients at points of render space and a walk over
// majorant segments, and it knows nothing of tracking (after pbrt-v4's medium interface).
//
// Units: coefficients are per render unit, that is σ of the scene file divided by the scale of render space.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "renderer/media/brick_field.h"
#include "renderer/media/cloud_field.h"
#include "renderer/media/emission_importance.h"
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

/// Whether distances of scatterings follow from σt, where a point's coefficients hold everywhere: it is positive wherever σs is.
inline bool has_closed_forms(const MediumPoint& m) {
  for (int c = 0; c < 3; ++c)
    if (m.sigma_s[c] > 0 && !(m.sigma_t[c] > 0)) return false;
  return true;
}

/// Something with one float value at each render-space point: `at(p)`, with `map()` into its own cells.
using FloatField = std::variant<BrickField<float>, CloudField>;
inline float look_up(const FloatField& field, DVec3 p) {
  if (const auto* bricks = std::get_if<BrickField<float>>(&field)) return bricks->at(p);
  return std::get_if<CloudField>(&field)->at(p);
}

/// One medium. Immutable and thread-safe; the same point gives the same bits on every thread.
class Medium {
 public:
  /// Throws `SceneError` at the medium's place when a value has no physical meaning (not finite, |g| > 0.9999, σ < 0).
  /// What was read differently than written is appended to `notes`, one sentence each. Only `terms` of the transfer equation
  /// count in what the methods say, except for bounds: these hold for σa + σs, so they bound σs as well.
  Medium(const MediumDescription& description, const DMat4& render_from_world, double scale, std::vector<std::string>& notes,
         const TransferTerms& terms = {});
  /// The sum of media that are no sums themselves: coefficients and emission add, phase functions mix by σs. It is
  /// homogeneous where all of them are.
  explicit Medium(std::vector<std::shared_ptr<const Medium>> parts);

  /// The same everywhere, without bounds of its own.
  bool is_homogeneous() const { return std::holds_alternative<Uniform>(kind_); }
  /// The coefficients of a homogeneous medium.
  const MediumPoint& homogeneous() const { return unit_; }

  /// The coefficients at a render-space point; zero outside a grid's box.
  MediumPoint at(DVec3 p) const;
  /// σt per channel at a render-space point: what shadow rays in chromatic media need.
  Rgb sigma_t(DVec3 p) const;
  /// σt at a render-space point where `is_grey()`: one float look-up.
  float grey_sigma_t(DVec3 p) const {
    if (const auto* grid = std::get_if<Grid>(&kind_)) return unit_.sigma_t.x * look_up(grid->density, p);
    return sigma_t(p).x;
  }
  /// The factor of `unit()` at a render-space point: 1 in homogeneous media. Only where `is_separable`.
  float density(DVec3 p) const;
  /// The coefficients at density 1; `emission` is set for homogeneous media only.
  const MediumPoint& unit() const { return unit_; }
  /// σa and σs are `density` times constants: true for all kinds but RGB grids and sums.
  bool is_separable() const { return is_homogeneous() || std::holds_alternative<Grid>(kind_); }

  /// The phase function at a render-space point.
  PhaseMix phase_at(DVec3 p) const { return parts_.empty() ? PhaseMix(phase_) : mixed_phase(p); }
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
  /// σt and σs are a density times constants that are equal in all channels.
  bool is_achromatic() const { return is_separable() && grey_ && unit_.sigma_s.x == unit_.sigma_s.y && unit_.sigma_s.y == unit_.sigma_s.z; }
  /// The average over its box of the mean channel of σt; of a sum, the sum of its parts' averages. An estimate that does not
  /// depend on a ray, for the weights of sampling strategies.
  double mean_sigma_t() const { return mean_sigma_t_; }
  /// The diagonal of the box in render units; of a sum, that of its smallest part. Infinite for homogeneous media.
  double diagonal() const;
  /// Only where `has_bricks()`.
  const MajorantGrid& majorants() const { return majorants_; }
  /// The bricks of `majorants()`, each with about the largest emission in it, the mean channel of σa Le, in place of the bound; null where
  /// nothing emits, or the medium is homogeneous or a sum. An estimate, for where to look.
  const MajorantGrid* largest_emission() const { return largest_emission_ ? &*largest_emission_ : nullptr; }
  /// Where the emission of a medium that is not homogeneous comes from; null where there is none. That of the homogeneous
  /// parts of a sum is left out.
  const EmissionImportance* emission_importance() const { return emission_importance_.get(); }
  /// It is neither homogeneous nor a sum.
  bool has_bricks() const { return std::holds_alternative<Grid>(kind_) || std::holds_alternative<RgbGrid>(kind_); }
  /// What a sum is made of; empty for other media.
  std::span<const std::shared_ptr<const Medium>> parts() const { return parts_; }

 private:
  /// Le = radiance × scale × scale_grid × blackbody(temperature), each factor where there is one.
  struct GridEmission {
    Rgb radiance{0};
    float scale = 0;
    std::optional<FloatField> scale_grid;
    std::optional<FloatField> temperature;
    float temperature_scale = 1, temperature_offset = 0, temperature_cutoff = 0;

    float kelvin(float value) const { return (value - temperature_offset) * temperature_scale; }
    Rgb at(DVec3 p) const;
  };
  /// The coefficients are the same everywhere: `unit_`.
  struct Uniform {};
  /// A density times `unit_`. May emit.
  struct Grid {
    FloatField density;
    GridEmission emission;
    Rgb unit_sigma_a{0};  ///< whether absorption counts or not: emission is σa · Le
  };
  /// σa and σs grids; an absent one is `absent` everywhere inside the box of the other.
  struct RgbGrid {
    std::optional<BrickField<Rgb>> sigma_a, sigma_s, emission;
    Rgb absent{0};
    TransferTerms terms;

    Rgb sigma_a_at(DVec3 p) const { return sigma_a ? sigma_a->at(p) : sigma_s->contains(p) ? absent : Rgb(0); }
    Rgb sigma_s_at(DVec3 p) const { return sigma_s ? sigma_s->at(p) : sigma_a->contains(p) ? absent : Rgb(0); }
    Rgb sigma_t_of(Rgb a, Rgb s) const { return (terms.absorption ? a : Rgb(0)) + (terms.out_scattering ? s : Rgb(0)); }
  };
  /// The sum of `parts_`.
  struct Sum {};
  struct Builder;

  Rgb sigma_s(DVec3 p) const;  ///< not of a sum
  Rgb sum_of_sigma_t(DVec3 p) const;
  PhaseMix mixed_phase(DVec3 p) const;

  std::variant<Uniform, Grid, RgbGrid, Sum> kind_;
  bool attenuates_ = false, scatters_ = false, emits_ = false, grey_ = true;
  float maximum_sigma_t_ = 0;
  double mean_sigma_t_ = 0;
  MediumPoint unit_;
  PhaseFunction phase_;
  MajorantGrid majorants_;
  std::shared_ptr<const EmissionImportance> emission_importance_;
  std::optional<MajorantGrid> largest_emission_;
  std::vector<std::shared_ptr<const Medium>> parts_;
};

/// The media of a scene, by their index in `SceneDescription::media`.
class Media {
 public:
  Media() = default;
  /// Render space is scale · (world − center), as `render_from_world` says. The terms of `scene.settings` count. Throws
  /// `SceneError`.
  Media(const SceneDescription& scene, const DMat4& render_from_world, double scale);

  const Medium& operator[](int index) const { return *media_[static_cast<size_t>(index)]; }
  int size() const { return static_cast<int>(media_.size()); }
  /// What was read differently than the files say; for the user.
  std::span<const std::string> notes() const { return notes_; }

 private:
  std::vector<std::shared_ptr<const Medium>> media_;
  std::vector<std::string> notes_;
};

/// σs/σt per channel; 0 where there is no extinction.
Rgb albedo(const MediumPoint& point);
inline Rgb albedo(const Medium& medium, DVec3 p) { return albedo(medium.at(p)); }

inline float Medium::density(DVec3 p) const {
  const auto* grid = std::get_if<Grid>(&kind_);
  return grid != nullptr ? look_up(grid->density, p) : 1;
}

inline Rgb Medium::sigma_t(DVec3 p) const {
  if (is_homogeneous()) return unit_.sigma_t;
  if (const auto* grid = std::get_if<Grid>(&kind_)) return unit_.sigma_t * look_up(grid->density, p);
  if (const auto* grid = std::get_if<RgbGrid>(&kind_)) return grid->sigma_t_of(grid->sigma_a_at(p), grid->sigma_s_at(p));
  return sum_of_sigma_t(p);
}

}  // namespace woodcock
