// The density of each technique that could have made a path, from the path alone: the independent function that weights
// are compared with.
#pragma once

#include "renderer/transport/path.h"
#include "tests/transport/weights/scattering_formulas.h"
#include "tests/transport/weights/scene_formulas.h"

namespace woodcock::testing {

/// Which techniques the render uses at all.
struct Techniques {
  bool light_sampling = true, equiangular = true, emission_sampling = true, mis = true, refraction = true, branches = true;
  bool by_power = false;   ///< lights are chosen by power
  bool rectangles = true;  ///< are sampled as such

  /// By the features of these settings, where the scene calls for `effects`.
  Techniques(uint32_t effects, const PathSettings& settings);
};

/// The last scattering of a path, or the camera.
struct LastVertex {
  enum class Kind { kCamera, kSurface, kMedium };
  Kind kind = Kind::kCamera;
  DVec3 p{0}, wo{0};
  int scatterings_before = 0;
  // At a surface: its model and frame.
  int material = kNone;
  bool closed_forms = true;  ///< of layered models
  DVec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  // In a medium: the segment that led to it, within that medium, its end if nothing had stopped it, the distance of the
  // scattering, and the share of each channel in the throughput at its start.
  int medium = kNone;
  DVec3 o{0}, d{0};
  double t = 0, t_max = 0;
  DVec3 share{1.0 / 3};

  DVec3 local(DVec3 w) const { return {glm::dot(w, x), glm::dot(w, y), glm::dot(w, z)}; }
};

/// Where a path ends.
struct LightEnd {
  enum class Kind { kShape, kPoint, kEnvironment, kEmission };
  Kind kind = Kind::kShape;
  int source = kNone;  ///< the light, or the medium that emits
  uint32_t primitive = 0;
  DVec3 p{0}, wi{0};
  bool by_delta_lobe = false;  ///< the vertex scattered by a delta lobe
  bool refracted = false;      ///< `wi` leads to the glass around the vertex, which refracts it towards p
};

/// A smooth boundary that a direction from inside meets.
struct Crossing {
  DVec3 v{0}, n{0}, wo{0};  ///< the point, the normal outwards, the refracted direction
  double cos_i = 1, cos_t = 1;
};
/// Nothing under total reflection.
std::optional<Crossing> cross(const Body& glass, DVec3 from, DVec3 w);

/// In a measure that all of them share: of the direction, at a vertex in a medium times its distance, for emission in media
/// times the distance to where it is emitted. What came before the last segment is left out, since it is common to all; so is
/// the roulette after the last vertex, which weights know nothing of.
struct Densities {
  double scattering = 0, light_sample = 0, equiangular = 0, emission_sample = 0, refracted_sample = 0;

  /// The power heuristic of exponent 2; without multiple importance sampling light samples stand for all they can make.
  Densities weights(bool mis) const;
  double sum() const { return scattering + light_sample + equiangular + emission_sample + refracted_sample; }
};

/// Throws TooNear where rounding decides which techniques there are.
Densities densities(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex, const LightEnd& end);

/// f of the vertex for the direction: |cos| included at surfaces, σs not included in media. Nothing for layered models by walks.
std::optional<DVec3> scattering_value(const SceneFormulas& scene, const LastVertex& vertex, DVec3 wi);
/// By how much tables may be off in both, relative.
double scattering_tolerance(const SceneFormulas& scene, const LastVertex& vertex, DVec3 wi);
/// Of the direction, by scattering.
double scattering_pdf(const SceneFormulas& scene, const LastVertex& vertex, DVec3 wi);
/// Of the direction of a branch towards a light: as if light came from there.
double branch_pdf(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex, DVec3 to_light, DVec3 wi);
/// Of a branch at a vertex that sampled a light there; 0 where the technique is not used. Throws TooNear.
double branch_probability(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex);
/// Of the distance t by free flight; where extinction varies, as if it had its mean everywhere.
double flight_pdf(const MediumFormula& medium, DVec3 share, DVec3 p, double t);
/// Of the distance towards the light, its choice included; 0 where the technique is not used.
double equiangular_pdf(const SceneFormulas& scene, const Techniques& techniques, const LastVertex& vertex, int light);

}  // namespace woodcock::testing
