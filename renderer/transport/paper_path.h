// What the estimators of the paper share beside the path machine: directions that are uniform, or drawn from the phase function, branches,
// and no light sampling.
//
// The paper is X. Ka, "Subsurface Rendering Using Monte Carlo Methods", 2020; docs/physics.md derives what was corrected in it.
#pragma once

#include "renderer/core/warp.h"
#include "renderer/media/extent.h"
#include "renderer/transport/path_machine.h"

namespace woodcock {

/// Scatters at a surface: a specular one by its model, any other into a direction uniform on the hemisphere, or on the sphere where the
/// surface transmits, with the weight f |cos|/pdf. Of a model with a delta lobe beside others one part is chosen by a coin and counts
/// twice. Local directions; nothing where the path ends.
std::optional<BsdfSample> scatter_uniformly(const Bsdf& bsdf, Vec3 wo, PathKey key, uint32_t vertex);

/// How a path scatters in media.
enum class ScatterDirections {
  kUniform,  ///< on the sphere: weight 4π f(ω, ω′) (eq. 9)
  kPhase     ///< drawn from the phase function: weight f/pdf, which is 1 (eq. 13)
};

/// `Estimator` gives `cross_medium` of the path machine.
template <typename Estimator>
class PaperPath : public PathMachine<kAllEffects, Estimator> {
  using Base = PathMachine<kAllEffects, Estimator>;
  friend Base;

 public:
  using Base::follow;

 protected:
  /// `branching`: directions at the first bounce.
  PaperPath(PathSample& sample, Ray ray, PathKey key, ScatterDirections directions, int branching = 1)
      : Base(sample, kAllEffects, ray, key), directions_(directions), branching_(branching) {
    begin_segment();
  }

  using Base::aov_weight_;
  using Base::begin_segment;
  using Base::beta_;
  using Base::coincident_;
  using Base::eta_scale_;
  using Base::key_;
  using Base::leave;
  using Base::may_scatter;
  using Base::medium_;
  using Base::medium_after_leaving;
  using Base::next_vertex;
  using Base::plan_;
  using Base::ray_;
  using Base::ray_towards;
  using Base::result_;
  using Base::roulette;
  using Base::sample_;
  using Base::start_weight_;
  using Base::travelled_;
  using Base::vertex_;
  using Base::world_;

  void add(Rgb radiance) { result_.radiance += beta_ * radiance; }

  /// The first event of a share of the sample, for the AOVs. `distance` from the origin of the ray, in render units.
  void see(float share, Rgb albedo, Vec3 normal, double distance) {
    if (!(share > 0)) return;
    result_.albedo += share * albedo;
    result_.normal += share * normal;
    result_.depth += share * static_cast<float>((travelled_ + distance) / world_.space.scale);
  }

  /// For sources that add up to no finite number: the sample becomes infinite, which is counted and reported.
  FlightEnd add_infinite_radiance() {
    result_.radiance = Rgb(kInf);
    sample_.stopped = true;
    return FlightEnd::kOver;
  }

  /// Whether the sources of an unbounded part add up to no finite number: in some channel there is a source and no extinction.
  bool is_infinite(const UnboundedPart& unbounded, bool scatters) const {
    const MediumPoint& m = unbounded.point;
    for (int c = 0; c < 3; ++c)
      if (beta_[c] > 0 && m.sigma_t[c] == 0 && (m.emission[c] > 0 || (scatters && m.sigma_s[c] > 0))) return true;
    return false;
  }

  /// A copy with numbers of its own, whose roulette is relative to `weight` times the throughput.
  Estimator branch(Rgb weight) const {
    Estimator copy = static_cast<const Estimator&>(*this);
    copy.become_branch(weight);
    return copy;
  }

  /// Scatters in a medium at p. False where roulette ends the path.
  bool scatter_in_medium(const Medium& medium, DVec3 p) {
    next_vertex();
    first_ = false;
    Stream random = stream(key_, vertex_, Purpose::kDirection);
    const Vec2 u = random.uniform2();
    const Vec3 wo(-ray_.d);
    if (directions_ == ScatterDirections::kUniform) {
      const Vec3 wi = square_to_sphere(u);
      beta_ *= medium.phase_at(p).eval(wo, wi) / square_to_sphere_pdf();
      return go_on({p, wi, ray_.time});
    }
    const auto s = medium.phase_at(p).sample(wo, u, random.uniform());
    beta_ *= s.weight;
    return go_on({p, s.wi, ray_.time});
  }

  bool first_ = true;  ///< nothing was met but boundaries and specular surfaces

 private:
  void become_branch(Rgb weight) {
    key_ = branch_key(key_, ++sample_.branches);
    beta_ *= weight;
    start_weight_ = max_component(glm::abs(beta_)) * eta_scale_;
    aov_weight_ = 0;
    first_ = false;
  }

  /// What scattering changes beside the throughput.
  bool go_on(const Ray& ray) {
    ray_ = ray;
    aov_weight_ = 0;
    begin_segment();
    return roulette() > 0;
  }

  /// The first bounce sends `branching` paths, later ones send one.
  bool scatter_at_surface(const SurfaceVertex& v, const Bsdf& bsdf) {
    const Frame frame = shading_frame(v.ns, v.s.dpdu);
    if (aov_weight_ > 0) see(aov_weight_, albedo(bsdf, frame.to_local(Vec3(-ray_.d))), v.ns, 0);
    aov_weight_ = 0;
    if (!may_scatter()) return false;
    if (first_ && branching_ > 1 && !is_specular(bsdf)) {
      const Rgb share(1.0f / static_cast<float>(branching_));
      for (int i = 0; i + 1 < branching_; ++i) {
        Estimator other = branch(share);
        if (other.bounce(v, bsdf, frame)) other.follow();
      }
      become_branch(share);
    }
    return bounce(v, bsdf, frame);
  }

  /// Scatters once. False where the path ends.
  bool bounce(const SurfaceVertex& v, const Bsdf& bsdf, const Frame& frame) {
    next_vertex();
    const auto scattered = scatter_uniformly(bsdf, frame.to_local(Vec3(-ray_.d)), key_, vertex_);
    if (!scattered) return false;
    beta_ *= scattered->weight;
    if (scattered->transmission) eta_scale_ *= scattered->eta * scattered->eta;
    first_ = first_ && is_specular(bsdf);
    const Vec3 wi = glm::normalize(frame.to_world(scattered->wi));
    medium_ = medium_after_leaving(v, wi, scattered->transmission);
    leave(v.hit, wi, v.next, scattered->transmission);
    return go_on(ray_towards(v.s, wi));
  }

  void add_emission(const Hit& hit, const SurfacePoint& s, int light) {
    add(world_.lights.emitted(light, {s.p, s.ng, s.uv, hit.primitive, hit.uv}, Vec3(-ray_.d)));
  }

  void add_environment() {
    if (world_.lights.has_environment()) add(world_.lights.environment(ray_.d));
  }

  const ScatterDirections directions_;
  const int branching_;
};

/// A RadianceFunction of the estimator `Path`; `more` is what its constructor takes beside the sample, the ray and the key.
template <typename Path, typename... More>
PathResult trace_paper_path(const World& world, const RenderPlan& plan, Ray ray, PathKey key, PathCounters& count, More... more) {
  ++count.paths;
  PathSample sample{world, plan, count};
  Path(sample, ray, key, more...).follow();
  return sample.result;
}

}  // namespace woodcock
