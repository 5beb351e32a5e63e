// What the estimators of the paper share: walks through the scene that scatter into uniform directions and sample no light.
//
// An estimator is a function `fly` that takes a walk through one medium; `follow` does the rest: rays, boundaries, surfaces, and
// what surfaces and the environment emit. The paper is X. Ka, "Subsurface Rendering Using Monte Carlo Methods", 2020;
// docs/physics.md derives what was corrected in it.
#pragma once

#include <optional>

#include "renderer/media/extent.h"
#include "renderer/transport/render_plan.h"
#include "renderer/transport/vertex.h"
#include "renderer/world/junction.h"

namespace woodcock {

/// One path between two events, or one branch of it.
struct Walk {
  Walk(Ray start, int start_medium, PathKey path) : ray(start), medium(start_medium), key(path), flight(0), crossing(0) { new_ray(); }

  /// New numbers for the flight from the current vertex; they go on across boundaries.
  void new_ray() {
    flight = stream(key, vertex, Purpose::kFreeFlight);
    crossing = stream(key, vertex, Purpose::kMaterial);
  }

  Ray ray;
  int medium;
  PathKey key;
  Rgb beta{1};             ///< throughput
  uint32_t vertex = 0;     ///< scatterings of this branch and of what led to it
  int depth = 0;           ///< the same, as the depth limit counts
  bool first = true;       ///< nothing was met but boundaries and specular surfaces
  float eta_scale = 1;     ///< η² of all refractions: what radiance changes by without loss
  float start_weight = 1;  ///< the largest channel of beta where this branch began
  float unseen = 1;        ///< the share of the sample whose first event is still to come, for the AOVs
  double travelled = 0;    ///< render units from the camera, as long as `unseen` is positive
  Stream flight, crossing;
  std::optional<Junction> here;  ///< the surfaces where the walk stands, if others may coincide with the one it met
};

/// How a walk leaves a medium.
enum class Flight {
  kThrough,    ///< at the end of the segment
  kScattered,  ///< in a new direction, from a point before that
  kOver,       ///< not at all
};

/// One sample in the making: what all of its walks add to.
struct WalkSample {
  const World& world;
  const RenderPlan& plan;
  PathCounters& count;
  PathResult result{};
  uint32_t branches = 0;  ///< begun so far; they number the keys
  uint64_t looks = 0;
  bool stopped = false;

  bool may_scatter(const Walk& w) const { return w.depth < plan.max_depth; }
  void add(const Walk& w, Rgb radiance) { result.radiance += w.beta * radiance; }
  /// The first event of a share of this sample, for the AOVs. `distance` from the walk's ray origin, in render units.
  void see(const Walk& w, float share, Rgb albedo, Vec3 normal, double distance);
  /// Counts a scattering of `w`; long samples show that they live and can be stopped.
  void next_vertex(Walk& w);
  /// The coefficients at a point: counted where they are looked up, and now and then a look at whether the sample is to end.
  MediumPoint look_up(const Medium& medium, DVec3 p) {
    if ((++looks & (kReportEvery - 1)) == 0 && plan.watch != nullptr)
      stopped = stopped || plan.watch->cancel.load(std::memory_order_relaxed);
    if (medium.is_homogeneous()) return medium.homogeneous();
    ++count.medium_lookups;
    return medium.at(p);
  }
  /// For sources that add up to no finite number: the sample becomes infinite, which is counted and reported.
  Flight diverge() {
    result.radiance = Rgb(kInf);
    stopped = true;
    return Flight::kOver;
  }
  /// A copy of `w` with numbers of its own, whose roulette is relative to `weight` times its throughput.
  Walk branch(const Walk& w, Rgb weight);
};

/// Scatters in a medium at `p` into a direction uniform on the sphere: weight 4π f(ω, ω′). False where roulette ends the walk.
bool scatter_uniformly(WalkSample& sample, Walk& w, const Medium& medium, DVec3 p);
/// The same into a direction drawn from the phase function: weight f/pdf, which is 1 (eq. 13).
bool scatter_by_phase(WalkSample& sample, Walk& w, const Medium& medium, DVec3 p);
using ScatterFunction = bool (*)(WalkSample&, Walk&, const Medium&, DVec3);

/// Whether its sources add up to no finite number: in some channel there is a source and no extinction.
bool diverges(const EndlessPart& endless, const Walk& w, bool scatters);

/// A surface or a boundary. Adds what it emits; a boundary or a missed alpha leads on; a specular surface passes the walk
/// on; any other sends `branching` walks (if the walk is at its first event, else one) into directions uniform on the
/// hemisphere, or on the sphere where the surface transmits: weight f |cos|/pdf. All but the last of them are handed to
/// `follow_branch`. False where the walk ends.
template <typename FollowBranch>
bool meet_surface(WalkSample& sample, Walk& w, const Hit& hit, const SurfacePoint& s, int member, int branching,
                  FollowBranch&& follow_branch);

/// What lies on a surface for a walk that meets it.
struct SurfaceMeeting {
  SurfacePoint point;
  int member = kNone;  ///< of the place where the walk stands
  int joined = kNone;  ///< a member that a transmission crosses, too: the dielectric body that begins where this one ends
  const SurfaceInfo* info = nullptr;
  std::optional<Bsdf> bsdf;
  Vec3 normal{0};  ///< shading
};
/// Adds emission and sees the surface, which is `member` of the place where the walk stands or kNone; empty bsdf where the
/// walk goes straight on, which has then been done.
SurfaceMeeting meet(WalkSample& sample, Walk& w, const Hit& hit, const SurfacePoint& s, int member);
/// The nearest hit of a walk: finds what coincides with it, if anything may, as the place where the walk stands.
SurfacePoint arrive(WalkSample& sample, Walk& w, const Hit& hit);
/// The next member to cross of the place where the walk stands; kNone when it has left the place.
int next_member(WalkSample& sample, Walk& w);
/// Scatters once. False where the walk ends.
bool bounce(WalkSample& sample, Walk& w, const SurfaceMeeting& meeting);
void meet_environment(WalkSample& sample, const Walk& w);

template <typename FollowBranch>
bool meet_surface(WalkSample& sample, Walk& w, const Hit& hit, const SurfacePoint& s, int member, int branching,
                  FollowBranch&& follow_branch) {
  const SurfaceMeeting meeting = meet(sample, w, hit, s, member);
  if (!meeting.bsdf) return true;
  if (!sample.may_scatter(w)) return false;
  if (w.first && branching > 1 && !is_specular(*meeting.bsdf)) {
    for (int i = 0; i + 1 < branching; ++i) {
      Walk branch = sample.branch(w, Rgb(1.0f / static_cast<float>(branching)));
      if (bounce(sample, branch, meeting)) follow_branch(branch);
    }
    w = sample.branch(w, Rgb(1.0f / static_cast<float>(branching)));
  }
  return bounce(sample, w, meeting);
}

/// Follows a walk to its end. `fly(w, hit)` takes it through the medium that it is in; `hit` ends the segment, nothing where it
/// has no end. `branching`: directions at the first bounce.
template <typename Fly>
void follow(WalkSample& sample, Walk w, int branching, const Fly& fly) {
  int crossings = 0;
  while (!sample.stopped) {
    if (++crossings > kMaxCrossings) {
      ++sample.count.truncated;
      return;
    }
    const uint32_t vertex_before = w.vertex;
    const auto follow_branch = [&](const Walk& branch) { follow(sample, branch, 1, fly); };
    if (const int member = next_member(sample, w); member != kNone) {
      const Junction::Member m = (*w.here)[member];
      if (!meet_surface(sample, w, m.hit, m.s, member, branching, follow_branch)) return;
      if (w.vertex != vertex_before) crossings = 0;
      continue;
    }
    ++sample.count.rays;
    const std::optional<Hit> hit = sample.world.geometry.intersect(w.ray, kInf);
    if (w.medium != kNone) {
      const Flight flight = fly(w, hit);
      if (flight == Flight::kOver) return;
      if (flight == Flight::kScattered) {
        crossings = 0;
        continue;
      }
    }
    if (!hit) return meet_environment(sample, w);
    const SurfacePoint s = arrive(sample, w, *hit);
    if (w.here) continue;
    if (!meet_surface(sample, w, *hit, s, kNone, branching, follow_branch)) return;
    if (w.vertex != vertex_before) crossings = 0;
  }
}

}  // namespace woodcock
