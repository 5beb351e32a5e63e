// What a path did, event by event, for tests that compute it again. The kernels that users run record nothing.
#pragma once

#include <optional>
#include <variant>
#include <vector>

#include "renderer/core/vec.h"

namespace woodcock {

/// In the mask of a kernel: it records. No scene calls for it, and no kernel of the list has it.
inline constexpr uint32_t kRecorded = 1u << 31;

/// How light was found.
enum class Technique {
  kScattering,       ///< a direction of the camera, a BSDF or a phase function met an area light
  kEnvironment,      ///< ... left the scene
  kCollision,        ///< ... met emission at a tentative collision
  kSegment,          ///< ... crossed homogeneous emission, in closed form
  kLightSample,      ///< a light was sampled from the last vertex
  kEquiangular,      ///< ... from a point at an equiangular distance on the segment
  kEmissionSample,   ///< a point of an emitting medium was sampled from the last vertex
  kRefractedSample,  ///< a light was sampled from the last vertex through the surface of smooth glass around it
};

// Positions, directions and lengths are those of render space; β is the throughput.

struct PathStarts {
  DVec3 beta;
};
struct SegmentStarts {
  DVec3 o, d;
  double t_max;
  int medium;
  DVec3 beta;
};
struct SegmentEnds {
  std::optional<double> t;  ///< of a scattering
  DVec3 beta;
};
struct MediumScatters {
  DVec3 p, wo;
  double t;
  int medium;
};
/// The vertex in a medium may send a branch towards the light, which it does with this probability.
struct BranchPossible {
  DVec3 to_light;
  double probability;
};
/// What comes until it ends belongs to the branch.
struct BranchStarts {
  DVec3 wi;
  DVec3 beta;
};
struct BranchEnds {};
struct SurfaceScatters {
  DVec3 p, wo, ng, ns, dpdu;
  int material;
};
struct DirectionTaken {
  DVec3 wi;
  double pdf;  ///< 0 for a delta lobe
  DVec3 beta;
};
struct RouletteSurvived {
  double q;
  DVec3 beta;
};
/// The vertex goes on in so many directions, each with its share of the throughput.
struct PathSplits {
  uint32_t directions;
};
/// One of them: what comes until the next one starts belongs to it.
struct SplitPart {
  DVec3 beta;
};
struct LightAdded {
  Technique technique;
  int source = -1;         ///< the light; of emission in media the medium
  uint32_t primitive = 0;  ///< of an area light
  DVec3 from{0}, wi{0};    ///< the vertex it is scattered at and the direction towards the light
  DVec3 p{0};              ///< on the light
  DVec3 boundary{0};       ///< of a refracted sample: where it passes the glass
  double length = 0;       ///< of a segment
  double t = 0;            ///< of an equiangular distance
  DVec3 transmittance{1};  ///< as estimated on all that was not the path's before
  DVec3 source_radiance{0};
  double density = 0;  ///< 0 where only `weight` is known
  double weight = 1;
  DVec3 beta{0}, added{0};
};

using PathEvent = std::variant<PathStarts, SegmentStarts, SegmentEnds, MediumScatters, BranchPossible, BranchStarts, BranchEnds,
                               SurfaceScatters, DirectionTaken, RouletteSurvived, PathSplits, SplitPart, LightAdded>;
using PathRecord = std::vector<PathEvent>;

}  // namespace woodcock
