// What a render did and what went wrong, counted by cause. Each thread has its own and adds them up.
#pragma once

#include <cstdint>
#include <optional>
#include <tuple>

namespace woodcock {

/// One sample of a frame, and how to name the first of several whatever the order in which they were rendered.
struct SampleId {
  int64_t sample = 0;
  int x = 0, y = 0;  ///< pixel of the full image
  bool operator<(const SampleId& o) const { return std::tie(sample, y, x) < std::tie(o.sample, o.y, o.x); }
};

struct PathCounters {
  uint64_t paths = 0;
  uint64_t vertices = 0;             ///< scatterings at surfaces and in media
  uint64_t rays = 0;                 ///< closest-hit queries of paths
  uint64_t shadow_rays = 0;          ///< light samples that were traced
  uint64_t medium_lookups = 0;       ///< coefficients of grid media evaluated
  uint64_t emission_lookups = 0;     ///< ... of which the emission, too
  uint64_t channel_draws = 0;        ///< distances drawn from one of several channels
  uint64_t nonfinite = 0;            ///< samples with a NaN or an infinity: they count as zero
  uint64_t nan_radiance = 0;         ///< ... of which the radiance was no number
  uint64_t infinite_radiance = 0;    ///< ... infinite; the rest had an AOV that was not finite
  uint64_t clamped = 0;              ///< samples that the film's maxcomponentvalue cut
  uint64_t majorant_violations = 0;  ///< look-ups with σt above the bound
  uint64_t truncated = 0;            ///< paths cut off after too many boundaries without a scattering
  std::optional<SampleId> first_nonfinite;

  void add(const PathCounters& o) {
    paths += o.paths;
    vertices += o.vertices;
    rays += o.rays;
    shadow_rays += o.shadow_rays;
    medium_lookups += o.medium_lookups;
    emission_lookups += o.emission_lookups;
    channel_draws += o.channel_draws;
    nonfinite += o.nonfinite;
    nan_radiance += o.nan_radiance;
    infinite_radiance += o.infinite_radiance;
    if (o.first_nonfinite && (!first_nonfinite || *o.first_nonfinite < *first_nonfinite)) first_nonfinite = o.first_nonfinite;
    clamped += o.clamped;
    majorant_violations += o.majorant_violations;
    truncated += o.truncated;
  }
};

}  // namespace woodcock
