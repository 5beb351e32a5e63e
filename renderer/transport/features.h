// The parts of the estimator `auto` that can be switched off one by one, to measure what each is worth.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace woodcock {

/// With any of them off the estimator stays unbiased; only its variance and its time change.
enum class Feature : uint32_t {
  kEquiangular,
  kEmissionSampling,
  kLightSampling,
  kMis,
  kClosedForms,
  kBricks,
  kRayMarchedShadows,
  kResidual,
  kRoulette,
  kSobol,
  kChannelMixture,
  kLayeredClosedForms,
  kLightTree,
  kDielectricBoundaries,
  kSplitting,
  kRectangleSampling,
  kTowardsLight,
  kLightRoulette,
  kEmissionCollisions,
};

struct FeatureInfo {
  Feature feature;
  const char* name;     ///< as `--without` takes it
  const char* meaning;  ///< one line: what there is with it
};

/// All features, in the order in which they are written to headers.
inline constexpr std::array<FeatureInfo, 19> kFeatures{{
    {Feature::kEquiangular, "equiangular", "distances to bounded lights in thin media in proportion to the light that arrives"},
    {Feature::kEmissionSampling, "emission-sampling", "bricks of media that emit are sampled as lights"},
    {Feature::kLightSampling, "light-sampling", "a light is sampled at every scattering"},
    {Feature::kMis, "mis", "light found in two ways is weighted by the power heuristic"},
    {Feature::kClosedForms, "closed-forms", "homogeneous media are crossed without tracking"},
    {Feature::kBricks, "bricks", "majorants hold for bricks of a volume, not for all of it"},
    {Feature::kRayMarchedShadows, "ray-marched-shadows", "media that only absorb are marched without bias, not tracked"},
    {Feature::kResidual, "residual", "shadow rays track only what differs from a known part of the extinction"},
    {Feature::kRoulette, "roulette", "paths of little weight end early"},
    {Feature::kSobol, "sobol", "the first dimensions of a path are Owen-scrambled Sobol' points"},
    {Feature::kChannelMixture, "channel-mixture", "distances where extinction differs by channel come from a mixture of the channels"},
    {Feature::kLayeredClosedForms, "layered-closed-forms",
     "coated surfaces are evaluated without walks where the sum over all walks is known"},
    {Feature::kLightTree, "light-tree", "a light is chosen by an estimate of what arrives at the point, not by its power"},
    {Feature::kDielectricBoundaries, "dielectric-boundaries", "lights are sampled through spheres and closed meshes of smooth glass"},
    {Feature::kSplitting, "splitting", "a path goes on in several directions from its first scattering, where that is worth while"},
    {Feature::kRectangleSampling, "rectangle-sampling", "rectangular lights are sampled as a whole, near ones by solid angle"},
    {Feature::kTowardsLight, "towards-light",
     "some scatterings in media that scatter forwards send a branch towards the light they sample"},
    {Feature::kLightRoulette, "light-roulette", "light samples in media that bring little end before their shadow ray is traced"},
    {Feature::kEmissionCollisions, "emission-collisions", "every ray has more collisions in bricks that emit much"},
}};

/// A set of features; all of them unless taken out.
class Features {
 public:
  bool has(Feature feature) const { return (off_ & bit(feature)) == 0; }
  bool all() const { return off_ == 0; }
  void take_out(Feature feature) { off_ |= bit(feature); }
  bool operator==(const Features&) const = default;

 private:
  static uint32_t bit(Feature feature) { return uint32_t{1} << static_cast<uint32_t>(feature); }
  uint32_t off_ = 0;
};

}  // namespace woodcock
