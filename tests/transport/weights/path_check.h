// Goes through the record of a path, makes a complete path of every contribution and compares density, weight and value
// with those of the independent function.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "renderer/transport/path_record.h"
#include "tests/transport/weights/complete_path.h"

namespace woodcock::testing {

/// What was compared and how far off it was.
struct CheckReport {
  static constexpr size_t kTechniques = 8;
  std::array<int64_t, kTechniques> contributions{};  ///< by Technique
  int64_t too_near = 0;                              ///< where rounding decides which techniques there are
  int64_t with_several = 0;                          ///< that more than one technique could have made
  int64_t exact_values = 0;                          ///< recomputed with the transmittance in closed form, too
  int64_t branches = 0;                              ///< towards lights that scattered
  int64_t shared = 0;                                ///< light samples that a branch could have made
  int64_t light_roulettes = 0;                       ///< light samples that survived one
  int64_t steps = 0;                                 ///< segments, directions, roulettes and media of the paths themselves
  double weight_deviation = 0;                       ///< largest difference of a weight
  double sum_deviation = 0;                          ///< largest of |Σ w − 1|, the used weight in place of the function's
  double density_deviation = 0;                      ///< largest relative difference of a density where rounding allows less than 10⁻³
  double value_deviation = 0;                        ///< ... of a value
  double worst = 0;                                  ///< largest difference of any kind over what rounding allows
  int64_t failed = 0;
  int64_t failed_weights = 0;         ///< of these, weights
  std::vector<std::string> failures;  ///< the first few

  int64_t total() const;
  void add(const CheckReport& other);
};

/// What is known of a path up to its last event.
struct PathState {
  struct Throughput {
    DVec3 f{1};    ///< of the path so far
    double p = 1;  ///< its density, roulette and splits included
    double slack = 2e-5;
    DVec3 beta() const { return f / p; }
  };
  /// A scattering that sampled lights and its direction, which glass refracted at the last vertex.
  struct Refraction {
    LastVertex vertex;
    DVec3 wi;
  };

  Throughput so_far_;
  LastVertex vertex_;
  SegmentStarts segment_{};
  DVec3 share_{1.0 / 3};
  DVec3 wi_{0};
  std::optional<Refraction> refraction_;
  bool by_delta_lobe_ = false, roulette_due_ = false;
  double survival_ = 1, eta_scale_ = 1;
  uint32_t directions_ = 1;  ///< that the path has split into
  int scatterings_ = 0;
  DVec3 recorded_beta_{1};
  std::optional<BranchPossible> branch_;      ///< of the last vertex
  double light_share_ = 1, share_slack_ = 0;  ///< of the last vertex's light samples
  double next_light_share_ = 1, next_slack_ = 0;
};

class PathCheck : private PathState {
 public:
  PathCheck(const SceneFormulas& scene, const PathSettings& settings, uint32_t effects);
  /// Adds what is found to `report`; `name` says which path it was.
  void check(const PathRecord& record, const std::string& name, CheckReport& report);

 private:
  /// Of the path itself in what light samples at the next vertex find, for a direction from `vertex` that a branch could have had.
  double light_share(const LastVertex& vertex, DVec3 wi) const;
  void see(const PathStarts& e);
  void see(const SegmentStarts& e);
  void see(const SegmentEnds& e);
  void see(const MediumScatters& e);
  void see(const BranchPossible& e);
  void see(const BranchStarts& e);
  void see(const BranchEnds& e);
  void see(const SurfaceScatters& e);
  void see(const DirectionTaken& e);
  void see(const RouletteSurvived& e);
  void see(const PathSplits& e);
  void see(const SplitPart& e);
  void see(const LightAdded& e);
  /// `origin` is the vertex that the techniques to be weighted start from, and `way` what leads from there to the end: `vertex` and `end`
  /// themselves, but for light met after glass refracted a direction.
  void check_contribution(const LightAdded& e, const LastVertex& vertex, const LightEnd& end, const LastVertex& origin,
                          const LightEnd& way);
  /// Through the glass around the vertex: transmittances, Fresnel and η², and what roulette divides by; nothing where it is an estimate.
  struct ThroughGlass {
    std::optional<DVec3> transmittance;
    double boundary = 1, survival = 1, depth = 0;
  };
  ThroughGlass through_glass(const LastVertex& vertex, const LightEnd& end) const;
  void check_value(const LightAdded& e, const LastVertex& vertex, const LightEnd& end, double density, double weight, double slack);
  void settle_roulette();

  /// `found` is within `allowed` of `expected`, both relative to `size`.
  void compare(const char* what, double found, double expected, double allowed, double* deviation = nullptr);
  void compare(const char* what, DVec3 found, DVec3 expected, double allowed, double* deviation = nullptr);
  void fail(const std::string& what);
  bool has(Feature feature) const { return settings_.features.has(feature); }
  bool may_scatter() const { return scatterings_ < settings_.max_depth; }
  bool is_closed(const MediumFormula& medium, double length) const {
    return medium.is_homogeneous() && ((settings_.plan && has(Feature::kClosedForms)) || !std::isfinite(length));
  }

  const SceneFormulas& scene_;
  const PathSettings& settings_;
  const Techniques techniques_;
  std::string name_;
  CheckReport* report_ = nullptr;
  const LightAdded* added_ = nullptr;  ///< that is looked at
  std::optional<PathState> fork_;      ///< where a branch towards a light left the path, while events are those of the branch
  PathState where_it_split_;
  uint32_t parts_ = 0;  ///< of the split, that have begun
};

}  // namespace woodcock::testing
