// What a coat without a scattering medium does to light, apart from what lies below it.
//
// Over a diffuse base the layered model has a closed form, since a diffuse reflection forgets where light came from: a
// coat then matters through two functions of one cosine and one number,
//
//   t(μ)  the share of light from a direction outside that reaches the base,
//   r(μ)  the share that the coat reflects outside at once,
//   Ri    the share of diffuse light from the base that the coat sends back to the base.
//
// A smooth coat has t and r in closed form: r = F(μ), t = (1 − F(μ)) exp(−thickness/μt), μt the refracted cosine. For a rough
// one they are integrals over the microfacets that the direction sees, tabulated here. Ri = 2 ∫ c exp(−thickness/c) ri(c) dc,
// ri(c) the share that comes back to the base from the inside cosine c, absorbed on its way down; a number of the coat.
#pragma once

#include <array>

#include "renderer/materials/ggx.h"

namespace woodcock {

/// Made at load by quadrature with fixed arithmetic: within 5e-4 of the integrals (a test compares). Immutable.
class CoatTable {
 public:
  /// `eta`: index of the coat over that of the outside, at least 1 for a rough coat. `roughness`: isotropic. `thickness`: mean free paths
  /// of a medium that only absorbs.
  CoatTable(float eta, Ggx roughness, float thickness);

  /// t(μ), μ ∈ [0, 1].
  float transmittance(float cosine) const;
  /// r(μ). Of a rough coat the mean of what its facets reflect to above, once.
  float reflectance(float cosine) const;
  /// Ri.
  float inner_reflectance() const { return inner_reflectance_; }
  /// 2 ∫ t(μ) μ dμ: t of light from everywhere.
  float mean_transmittance() const { return mean_transmittance_; }

 private:
  static constexpr int kIntervals = 128;

  /// Linear in √μ, which is fine where grazing directions need it.
  float look_up(const std::array<float, kIntervals + 1>& table, float cosine) const;

  float eta_, thickness_;
  bool delta_;
  float inner_reflectance_ = 0, mean_transmittance_ = 0;
  std::array<float, kIntervals + 1> transmittance_{}, reflectance_{};  ///< of rough coats
};

/// Σ q^k over k < n, q ≥ 0. Of + and × only.
float geometric_sum(float q, int n);

}  // namespace woodcock
