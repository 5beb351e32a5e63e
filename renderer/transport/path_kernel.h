// The path loop of the estimator `auto`, compiled for a set of effects.
//
//   L(x, ω) = ∫₀ᶻ T(s) [σa Le + σs ∫ f(ω, ω′) L(ω′) dω′] ds + T(z) L₀
//
// with L₀ from the rendering equation (Kajiya 1986) at surfaces. The loop itself is that of path_machine.h. This is what the estimator
// does: at surfaces in path_kernel_surface.h, in media in path_kernel_media.h and path_kernel_towards_light.h, with light in
// path_kernel_light.h and path_kernel_refraction.h. kernel_group.h includes all of them.
#pragma once

#include <algorithm>
#include <cmath>
#include <tuple>
#include <type_traits>
#include <utility>

#include "renderer/core/frame.h"
#include "renderer/media/extent.h"
#include "renderer/transport/equiangular.h"
#include "renderer/transport/kernels.h"
#include "renderer/transport/mis.h"
#include "renderer/transport/path_machine.h"
#include "renderer/transport/path_record.h"
#include "renderer/transport/tentative_collisions.h"

namespace woodcock {

/// One path of the estimator `auto`.
///
/// Extinction may differ between channels. Each decision is then drawn from a mixture of the channels' densities,
/// every channel with a share in proportion to its throughput β, and β is divided by that mixture: the balance
/// heuristic over one technique a channel (Veach 1997, section 9.2.2; Wilkie et al. 2014; null-scattering paths: Miller,
/// Georgiev & Jarosz 2019; shares that know the path so far: Kutz, Habel, Li & Novák 2017). The sum of β over the
/// channels then never grows, whatever the coefficients, and a channel without extinction is no special case.
template <uint32_t kMask>
class PathKernel : public PathMachine<kMask, PathKernel<kMask>> {
  using Base = PathMachine<kMask, PathKernel<kMask>>;
  friend Base;

 public:
  PathKernel(PathSample& sample, Ray ray, PathKey key)
      : Base(sample, sample.plan.effects, ray, key), channel_(0), equiangular_(0), directions_(sample.plan.splits) {
    if (uses(kChromaticExtinction) && !plan_.channel_mixture) {
      // One channel a path, each in turn at random: the others carry nothing.
      const int only = std::min(2, static_cast<int>(3 * stream(key, 0, Purpose::kHeroChannel).uniform()));
      beta_ = Rgb(0);
      beta_[only] = 3;
    }
    begin_segment();
  }

  /// Where the next run is recorded; in recording kernels only.
  void record(PathRecord& record) requires((kMask & kRecorded) != 0) { record_ = &record; }

  PathResult run() {
    note([&] { return PathStarts{beta_}; });
    this->follow();
    return result_;
  }

 private:
  using Base::aov_weight_;
  using Base::beta_;
  using Base::coincident_;
  using Base::count_;
  using Base::depth_;
  using Base::eta_scale_;
  using Base::flight_;
  using Base::key_;
  using Base::kMedia;
  using Base::kTouching;
  using Base::leave;
  using Base::may_scatter;
  using Base::medium_;
  using Base::medium_after_leaving;
  using Base::next_vertex;
  using Base::plan_;
  using Base::ray_;
  using Base::ray_towards;
  using Base::result_;
  using Base::sample_;
  using Base::start_weight_;
  using Base::travelled_;
  using Base::uses;
  using Base::vertex_;
  using Base::world_;

  /// Tells a test what happened; nothing at all in the kernels that users run.
  template <typename Event>
  void note(Event&& event) {
    if constexpr ((kMask & kRecorded) != 0) record_->push_back(event());
  }

  /// Adds light that arrives at the last vertex; `facts` are a LightAdded.
  template <typename Facts>
  void add(Rgb radiance, Facts&& facts) {
    note([&] {
      LightAdded added = facts();
      added.beta = beta_;
      added.added = DVec3(beta_) * DVec3(radiance);
      return added;
    });
    result_.radiance += beta_ * radiance;
  }

  /// New numbers for the segment from the current vertex; they go on across boundaries.
  void begin_segment() {
    Base::begin_segment();
    if constexpr ((kMask & kChromaticExtinction) != 0) channel_ = stream(key_, vertex_, Purpose::kHeroChannel);
    if constexpr ((kMask & kEquiangular) != 0) equiangular_ = stream(key_, vertex_, Purpose::kEquiangular);
  }

  // --- media ---------------------------------------------------------------------------------------------

  /// Inside a ball of glass that holds a homogeneous medium and nothing else the free flight is drawn first: where it ends inside, there
  /// is no hit to look for.
  std::optional<Hit> find_hit();

  /// Whether nothing but the free flight asks where the segment ends.
  bool draws_before_hit(const Medium& medium) const;

  FlightEnd cross_medium(const std::optional<Hit>& hit);

  /// Flies through the current medium up to t_max: adds its emission, and returns the distance of a scattering, with
  /// the throughput updated, or nothing when the ray gets through.
  std::optional<double> sample_distance(double t_max);

  bool is_chromatic(const Medium& medium) const { return uses(kChromaticExtinction) && !(plan_.transmittance.grey && medium.is_grey()); }

  /// The distance of a free flight in a homogeneous medium, and the channel that it was drawn for.
  struct FreeFlight {
    double t;
    int channel;
  };
  FreeFlight draw_flight(const MediumPoint& m, bool chromatic) {
    const int channel = chromatic ? choose_channel(shares()) : 0;
    const float sigma = m.sigma_t[channel];
    return {sigma > 0 ? static_cast<double>(flight_.exponential()) / static_cast<double>(sigma) : static_cast<double>(kInf), channel};
  }

  /// Closed forms. Emission of the whole segment: ∫₀ᵗ exp(−σt s) σa Le ds.
  std::optional<double> sample_distance_homogeneous(const MediumPoint& m, bool chromatic, double t_max);

  /// Through a sum without end: to the last of its grids by tracking, which would never end where a channel has no extinction,
  /// and from there on by closed forms.
  std::optional<double> sample_distance_unbounded(const Medium& medium, const UnboundedPart& unbounded);

  /// Unbiased ray marching may turn the sign of β: decisions go by its size.
  Rgb shares() const {
    const Rgb size = glm::abs(beta_);
    return size / (size.r + size.g + size.b);
  }

  /// In long flights, now and then: whether the render is to end.
  bool is_cancelled() {
    if (!flight_is_cancelled(plan_.transmittance, count_)) return false;
    sample_.stopped = ended_ = true;
    return true;
  }

  /// Sources that nothing dims, without end: they add up to no finite number, which is counted and reported.
  std::optional<double> add_infinite_radiance() {
    result_.radiance = Rgb(kInf);
    ended_ = true;
    return std::nullopt;
  }

  /// A channel with probability `share`, which sums to one.
  int choose_channel(Rgb share) {
    ++count_.channel_draws;
    const double u = channel_.uniform_double();
    if (u < static_cast<double>(share.r)) return 0;
    return u < static_cast<double>(share.r) + static_cast<double>(share.g) || !(share.b > 0) ? 1 : 2;
  }

  /// Woodcock tracking with weights: at a tentative collision under the majorant σ̄ the path scatters with probability
  /// q = σs/(σs + σn), σn = σ̄ − σt, and goes on otherwise; either way its weight is (σs + σn)/σ̄, which with all terms is
  /// 1 − σa/σ̄, so that absorption dims paths and never kills them (Raab, Seibert & Keller 2006; Galtier et al. 2013).
  /// Channels share σ̄, so their mixture needs no more than q = β·σs / β·(σs + σn). Emission adds σa Le/σ̄ at every
  /// tentative collision.
  std::optional<double> track(const Medium& medium, double t_max);

  /// The same for one number in place of three. In a brick of constant density every collision is a scattering.
  std::optional<double> track_achromatic(const Medium& medium, double t_max);

  /// σn, which a violated bound makes negative. Rounding of the interpolation is no violation; the bound carries an
  /// allowance for it.
  float checked_null(float sigma_n, float majorant) {
    if (sigma_n >= 0) return sigma_n;
    if (sigma_n < -1e-4f * majorant) ++count_.majorant_violations;
    return 0;
  }

  /// Tentative collisions per render unit that an emitting grid gets at the least: four on the way through, so that thin
  /// but bright gas is met by most rays and not by one in a thousand.
  static float emission_rate(const Medium& medium, double t_max) { return static_cast<float>(4 / std::min(medium.diagonal(), t_max)); }

  /// Emission met at a tentative collision. It could have been sampled as a light, too: in the measure dω dt this ray came
  /// with the density of its direction times the rate of collisions, for which a constant of the medium stands.
  void add_volume_emission(const Medium& medium, Rgb radiance, DVec3 p);
  static float typical_rate(const Medium& medium) { return static_cast<float>(std::max(4 / medium.diagonal(), medium.mean_sigma_t())); }

  bool scatter_in_medium(double t, DVec3 p);

  /// Takes a direction drawn from the phase function, where a branch towards `to_light` may be sent with this probability. False where the
  /// path ends.
  bool leave_in_medium(const PhaseMix& phase, DVec3 p, Vec3 wo, Vec3 to_light, float branch_probability);

  /// At the first scattering by which light was sampled the path goes on in as many directions as the plan says, each with its share of the
  /// throughput: `take_one(part, is_path)` does that. The last of them is the path itself.
  template <typename TakeOne>
  bool split(TakeOne&& take_one) {
    const uint32_t directions = std::exchange(directions_, 1u);
    if (directions == 1) return take_one(*this, true);
    beta_ /= static_cast<float>(directions);
    start_weight_ /= static_cast<float>(directions);
    note([&] { return PathSplits{directions}; });
    const PathKey key = key_;
    for (uint32_t i = 1; i < directions; ++i) {
      PathKernel part(*this);
      part.key_ = split_key(key, i, directions);
      note([&] { return SplitPart{beta_}; });
      if (take_one(part, false)) part.follow();
    }
    key_ = split_key(key, 0, directions);
    note([&] { return SplitPart{beta_}; });
    return take_one(*this, true);
  }

  // --- branches towards a light ----------------------------------------------------------------------------

  /// Where a medium scatters forwards, a light sample is much larger than others when the path happens to head for the light. So some
  /// scatterings send a branch with this probability: its direction w is drawn as if light came from where the light sample of the
  /// vertex lies, with the density q(w); it scatters once more in the same medium, samples a light there and ends. Light samples of
  /// the path's own next vertex take part in what can be found in both ways (directional importance sampling: Buras & Mayer 2011,
  /// "Efficient unbiased variance reduction techniques for Monte Carlo simulations of radiative transfer in cloudy atmospheres", section
  /// 3.3). With p(w) the density of the path's own direction, both are divided by p(w) + probability · q(w): the balance heuristic.
  static constexpr float kBranchProbability = 0.15f;
  /// Beside equiangular distances, where what passes the light closely is most of the noise.
  static constexpr float kPassingBranchProbability = 0.3f;
  /// Per steradian: phase functions of a lower density straight ahead scatter too evenly for it.
  static constexpr float kMinForwardPeak = 0.3f;
  static constexpr uint32_t kTowardsLightBranch = 1;

  /// The probability of a branch at a vertex in a medium; 0 where none is worth while.
  float branch_probability(const PhaseMix& phase) const;
  /// The direction of a branch and its density. Where distances are equiangular light is brightest close to its source, and a ray brings
  /// in proportion to the inverse of its distance from there: so the angle to the light sample is uniform, q(w) = 1/(2π² sin θ), and
  /// nothing depends on how closely a ray passes. Else q is the phase function of light that comes from there.
  Vec3 branch_direction(const PhaseMix& phase, Vec3 to_light, Stream& random) const;
  float branch_pdf(const PhaseMix& phase, Vec3 to_light, Vec3 w) const;
  void branch_towards_light(const PhaseMix& phase, Vec3 wo, DVec3 p, Vec3 to_light, float probability);

  // --- surfaces ------------------------------------------------------------------------------------------

  static Rgb eval_model(const Bsdf& b, Vec3 wo, Vec3 wi, Stream& layered) { return eval(b, wo, wi, layered); }
  static Rgb eval_model(const DiffuseBsdf& b, Vec3 wo, Vec3 wi, Stream&) { return eval(b, wo, wi); }
  static auto sample_model(const Bsdf& b, Vec3 wo, Stream& direction, Stream& layered) { return sample(b, wo, direction, layered); }
  static auto sample_model(const DiffuseBsdf& b, Vec3 wo, Stream& direction, Stream&) { return sample(b, wo, direction); }

  /// `Model` is Bsdf, or DiffuseBsdf where nothing else is there.
  template <typename Model>
  bool scatter_at_surface(const SurfaceVertex& v, const Model& bsdf);

  /// Takes a direction drawn from the material. False where the path ends.
  template <typename Model>
  bool leave_surface(const SurfaceVertex& v, const Model& bsdf, const Frame& frame, Vec3 wo, Stream layered);

  // --- light ---------------------------------------------------------------------------------------------

  /// What a scattering makes of a direction.
  struct Scattered {
    Rgb value{0};   ///< f, at surfaces times |cos|
    float pdf = 0;  ///< of sampling the direction by scattering, per solid angle
    Ray shadow;
    int medium = kNone;  ///< in which the shadow ray starts
    bool in_medium = false;
  };

  /// The probability with which a light sample is traced; what it brings is divided by it.
  float light_survival(const Scattered& scattered) const {
    if (!uses(kVolumeScattering) || !scattered.in_medium || !plan_.light_roulette) return 1;
    return light_sample_survival(beta_ * scattered.value / start_weight_);
  }

  template <typename Evaluate>
  void sample_lights(DVec3 reference, Evaluate&& evaluate) {
    if (uses(kLightSampling)) sample_light(reference, evaluate);
    if (uses(kEmissionSampling)) sample_emission(reference, evaluate);
  }

  Shadow shadow(const Ray& ray, double distance, int medium, TargetPrimitive target, Stream& random) {
    return trace_shadow(world_, ray, distance, medium, target, random, plan_.transmittance, uses(kTransparentSurfaces), count_,
                        uses(kTouching) && coincident_ ? &*coincident_ : nullptr);
  }

  /// Next-event estimation: one light, chosen by what arrives at the reference point.
  template <typename Evaluate>
  void sample_light(DVec3 reference, Evaluate&& evaluate);

  /// Points a shadow ray that starts beside the reference point at the light sample. Gives the distance; nothing where they coincide, or
  /// where the ray starts on the other side of what emits: a light must not light itself, whose points are off it by their error.
  static std::optional<double> aim(const LightSample& light, Ray& ray);

  // --- light through smooth glass --------------------------------------------------------------------------

  /// A scattering at `from`, in a direction of density `pdf`, that smooth glass refracted at v before anything else scattered.
  struct Refraction {
    const SurfaceInfo* info;
    Hit hit;
    DVec3 from, v;
    float pdf;
  };

  /// The body of smooth glass that light from a certain place meets from outside; one of the two, or none.
  struct Glass {
    const DielectricSphere* sphere = nullptr;
    std::optional<DielectricMeshes::Exit> mesh;
  };
  /// `sphere` is the one around `from`; d the unit vector towards the light, which lies at `distance`.
  Glass glass_towards(const DielectricSphere* sphere, DVec3 from, DVec3 d, double distance) const;

  /// A way through glass, with what the path loop needs beyond it.
  struct WayThrough {
    const RefractedWay& way;
    const SurfaceInfo& surface;
    float eta;        ///< index inside over that outside
    Vec3 ng;          ///< the shape's normal
    DVec3 outside;    ///< where a ray that left begins
    bool is_empty;    ///< nothing but the medium lies on the way to the glass
    double survives;  ///< the probability of being traced
  };

  /// Below this transmittance roulette decides whether a sample through glass is worth a shadow ray.
  static constexpr double kRefractionRoulette = 0.25;

  /// A light sample outside of the glass that is around the reference point: all ways that lead there by one refraction,
  ///   f(x, wi) T(x, v) (1 − F) η² T(v, y) Le dω/dA,
  /// over the density of y by area. With dω/dω′, the solid angle around the refracted direction over that around the straight one, this is
  /// a density in solid angle again.
  template <typename Evaluate>
  void sample_through_glass(const Glass& glass, const Lights::Choice& choice, const LightSample& light, DVec3 reference,
                            Evaluate&& evaluate);
  template <typename Evaluate>
  void add_refracted(const WayThrough& through, const Lights::Choice& choice, const LightSample& light, DVec3 reference, Stream& tracking,
                     Evaluate&& evaluate);

  /// Of light from deep inside little arrives: roulette by the transmittance, first as if the surface was as near as it can be. In steps
  /// with one number, so that the light that goes on is divided by the last probability alone.
  struct RefractionRoulette {
    double u, sigma;  ///< σ > 0 where the body holds one homogeneous medium
    double survival(double length) const { return sigma > 0 ? std::min(1.0, std::exp(-sigma * length) / kRefractionRoulette) : 1.0; }
    double longest() const { return sigma > 0 ? -std::log(u * kRefractionRoulette) / sigma : static_cast<double>(kInf); }
  };
  RefractionRoulette refraction_roulette(bool is_empty) const;
  bool survives_refraction(const DielectricSphere& body, DVec3 from) const;
  /// The same in a mesh with nothing inside.
  bool survives_refraction_by_mesh(DVec3 from) const;

  /// Whether a way through a mesh is sampled: not where something else coincides with it, since more than one boundary is crossed there.
  bool is_alone(const MeshWay& found, DVec3 from) const;

  /// dω/dω′ of a way to the point p on a light with the normal n.
  static double solid_angle_ratio(const RefractedWay& way, DVec3 from, DVec3 p, DVec3 n);

  /// The MIS weight of light met after a refraction: solved again, so that a way that the solver does not find has the weight 1.
  float refraction_weight(const Refraction& refraction, const EmitterHit& emitter, int light) const;

  /// A point of an emitting grid, its bricks chosen by power: ∫ f T σa Le dω dt over the points of the medium.
  template <typename Evaluate>
  void sample_emission(DVec3 reference, Evaluate&& evaluate);

  void add_emission(const Hit& hit, const SurfacePoint& s, int light);

  void add_environment();

  // --- equiangular distances -----------------------------------------------------------------------------

  /// Flights from later vertices are not worth a second shadow ray (measured on the fog, efficiency with flights from one,
  /// two, three and all vertices: 1.49, 1.73, 1.75 and 1.43 of that without any).
  static constexpr uint32_t kEquiangularVertices = 3;
  /// A light that sees less of the way than this is far from all of it, and free flight does as well.
  static constexpr double kMinAngle = 0.8;

  /// A segment of a medium, for the densities of what might have happened on it.
  struct FlightSegment {
    Ray ray;
    double t_max, t;  ///< its end and the distance of the scattering
    int medium;
    Rgb share;  ///< of the channels at its start
  };

  /// The last segment as the flight that led to a scattering at t; nothing where no distance on it was sampled so.
  std::optional<FlightSegment> flight_to(double t) const {
    if (vertex_ >= kEquiangularVertices) return std::nullopt;
    FlightSegment flight = this_flight_;
    flight.t = t;
    return flight;
  }

  /// Light of a bounded light scattered once on the way, at a distance in proportion to the inverse square of the distance
  /// to the light. The same light is found by free flight and light sampling, and by free flight and chance; the three are
  /// weighted by the power heuristic in the measure dt dω. Weights know σt of homogeneous media and its mean in others,
  /// never an estimate of the transmittance.
  void sample_equiangular(const Medium& medium, double t_max);

  /// A light farther away than this many mean free paths is found by free flight.
  static bool is_near(const Medium& medium, DVec3 from, DVec3 position) { return medium.mean_sigma_t() * glm::length(position - from) < 4; }

  /// The density of the distance t by free flight, per render unit; in heterogeneous media that of their mean.
  float flight_density(const Medium& medium, Rgb share, double t) const;

  /// How much likelier than by free flight the last vertex, if it lies in a medium, is reached by equiangular sampling
  /// towards this light, its choice included.
  float equiangular_odds(int light) const;

  // --- bookkeeping ---------------------------------------------------------------------------------------

  /// The first event, for the AOVs.
  void record_first_hit(Rgb albedo, Vec3 normal) {
    aov_weight_ = 0;
    result_.albedo = albedo;
    result_.normal = normal;
    result_.depth = static_cast<float>(travelled_ / world_.space.scale);
  }

  void after_scattering(DVec3 at) {
    reference_ = at;
    begin_segment();
  }

  /// False where the path ends.
  bool survives_roulette() {
    const float q = this->roulette();
    if (q > 0 && q < 1) note([&] { return RouletteSurvived{q, beta_}; });
    return q > 0;
  }

  Stream channel_, equiangular_;
  uint32_t directions_;  ///< that the path takes at its next scattering that samples light
  FlightSegment this_flight_;
  std::optional<FlightSegment> last_flight_;  ///< that led to the last vertex; nothing where that is no scattering in a medium
  /// Of the last scattering: the point it happened at and the pdf of the direction, 0 where light sampling could not
  /// have given it (camera, specular).
  DVec3 reference_{0};
  float direction_pdf_ = 0;
  std::optional<Vec3> light_direction_;  ///< of the light sample at the last vertex
  /// Of the path itself in what light samples at the next vertex find, beside branches from the last; 1 once it has left the medium.
  float next_light_share_ = 1;
  std::optional<FreeFlight> drawn_;       ///< through the segment to come, if its hit was not needed for it
  double no_hit_until_ = kInf;            ///< how far nothing is in the way of the segment, where no hit was looked for
  std::optional<Refraction> refraction_;  ///< that led to the last vertex, after a scattering that sampled lights
  bool ended_ = false;                    ///< in the segment that is crossed

  struct NoRecord {};
  [[no_unique_address]] std::conditional_t<(kMask & kRecorded) != 0, PathRecord*, NoRecord> record_{};
};

}  // namespace woodcock
