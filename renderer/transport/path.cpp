#include "renderer/transport/path.h"

#include <algorithm>
#include <cmath>

#include "renderer/transport/tentative_collisions.h"
#include "renderer/transport/transmittance.h"

namespace woodcock {
namespace {

/// The power heuristic for two strategies (Veach 1997, section 9.2.4), written as a ratio so that large pdfs do not
/// overflow.
float mis_weight(float pdf, float other) {
  if (!(pdf > 0)) return 0;
  const float r = other / pdf;
  return 1 / (1 + r * r);
}

/// A frame around ns whose first axis follows ∂p/∂u, for anisotropic roughness.
Frame shading_frame(Vec3 ns, Vec3 dpdu) {
  const Vec3 s = dpdu - ns * glm::dot(ns, dpdu);
  const float length2 = length_squared(s);
  if (!(length2 > 1e-12f * length_squared(dpdu))) return Frame::from_normal(ns);
  const Vec3 unit = s / std::sqrt(length2);
  return {unit, glm::cross(ns, unit), ns};
}

/// j (1 − exp(−σ t))/σ per channel: what a segment of length t emits towards its start. A channel that emits also
/// absorbs, so σ > 0 wherever j > 0, and an unbounded segment is finite.
Rgb segment_emission(Rgb j, Rgb sigma, float t) {
  Rgb result{0};
  for (int c = 0; c < 3; ++c) {
    if (j[c] > 0)
      result[c] =
          static_cast<float>(-std::expm1(-static_cast<double>(sigma[c]) * t) * (static_cast<double>(j[c]) / static_cast<double>(sigma[c])));
  }
  return result;
}

/// Tentative collisions per render unit that an emitting grid gets at the least: four on the way through, so that thin
/// but bright gas is met by most rays and not by one in a thousand.
float emission_rate(const Medium& medium, float t_max) {
  const CellBox& box = medium.majorants().box();
  const double diagonal = glm::length(box.upper - box.lower) * medium.majorants().map().cell_edge();
  return static_cast<float>(4 / std::min(diagonal, static_cast<double>(t_max)));
}

/// One path. Members carry what the next event needs; see trace_path for the equation.
///
/// Extinction may differ between channels. Each decision is then drawn from a mixture of the channels' densities,
/// every channel with a share in proportion to its throughput β, and β is divided by that mixture: the balance
/// heuristic over one technique a channel (Veach 1997, section 9.2.2; Wilkie et al. 2014; shares that know the path so
/// far: Kutz, Habel, Li & Novák 2017). The sum of β over the channels then never grows, whatever the coefficients,
/// and a channel without extinction is no special case.
class Path {
 public:
  Path(const World& world, const PathSettings& settings, Ray ray, PathKey key, PathCounters& count)
      : world_(world),
        settings_(settings),
        count_(count),
        key_(key),
        ray_(ray),
        medium_(world.camera_medium),
        flight_(0),
        channel_(0),
        crossing_(0) {
    begin_segment();
  }

  PathResult run() {
    int crossings = 0;
    while (true) {
      if (++crossings > kMaxCrossings) {
        ++count_.truncated;
        break;
      }
      ++count_.rays;
      const auto hit = world_.geometry.intersect(ray_, kInf);
      if (medium_ != kNone) {
        const auto t = fly(hit ? static_cast<float>(hit->t) : kInf);
        if (ended_) break;
        if (t) {
          if (!scatter_in_medium(*t, hit ? before_boundary(*t, *hit) : ray_.at(*t))) break;
          crossings = 0;
          continue;
        }
      }
      if (!hit) {
        add_environment();
        break;
      }
      travelled_ += hit->t;
      const uint32_t vertex_before = vertex_;
      if (!meet_surface(*hit)) break;
      if (vertex_ != vertex_before) crossings = 0;
    }
    return result_;
  }

 private:
  void add(Rgb radiance) { result_.radiance += beta_ * radiance; }

  /// New numbers for the flight from the current vertex; they go on across interfaces.
  void begin_segment() {
    flight_ = stream(key_, vertex_, Purpose::kFreeFlight);
    channel_ = stream(key_, vertex_, Purpose::kHeroChannel);
    crossing_ = stream(key_, vertex_, Purpose::kMaterial);
  }

  bool may_scatter() const { return depth_ < settings_.max_depth; }

  /// Flies through the current medium up to t_max: adds its emission, and returns the distance of a scattering, with
  /// the throughput updated, or nothing when the ray gets through.
  std::optional<float> fly(float t_max) {
    const Medium& medium = world_.media[medium_];
    return medium.is_homogeneous() ? fly_homogeneous(medium, t_max) : fly_grid(medium, t_max);
  }

  /// Closed forms. Emission of the whole segment: ∫₀ᵗ exp(−σt s) σa Le ds.
  std::optional<float> fly_homogeneous(const Medium& medium, float t_max) {
    const MediumPoint& m = medium.homogeneous();
    const Rgb sigma_t = m.sigma_t;
    if (medium.emits()) add(segment_emission(m.emission, sigma_t, t_max));
    if (!medium.scatters() || !may_scatter()) {
      beta_ *= attenuation(sigma_t, t_max);
      ended_ = is_black(beta_);
      return std::nullopt;
    }
    if (medium.is_grey()) {
      const float t = flight_.exponential() / sigma_t.x;
      if (t >= t_max) return std::nullopt;
      beta_ *= m.sigma_s / sigma_t.x;
      return t;
    }
    const Rgb share = beta_ / (beta_.r + beta_.g + beta_.b);
    const int hero = choose_channel(share);
    const float hero_sigma = sigma_t[hero];
    const float t = hero_sigma > 0 ? flight_.exponential() / hero_sigma : kInf;
    const bool through = t >= t_max;
    // Transmittances relative to the hero's: exp(−(σt − σt_hero) t), formed in the exponent so that the ratio of two
    // numbers too small for a float is right.
    Rgb relative{1};
    for (int c = 0; c < 3; ++c) {
      if (sigma_t[c] != hero_sigma) relative[c] = std::exp((hero_sigma - sigma_t[c]) * std::min(t, t_max));
    }
    const Rgb value = through ? relative : relative * m.sigma_s, density = through ? relative : relative * sigma_t;
    const float mixture = glm::dot(share, density);
    beta_ *= mixture > 0 ? value / mixture : Rgb(0);
    ended_ = is_black(beta_);
    if (through) return std::nullopt;
    return t;
  }

  /// A channel with probability `share`, which sums to one.
  int choose_channel(Rgb share) {
    const float u = channel_.uniform();
    if (u < share.r) return 0;
    return u < share.r + share.g || !(share.b > 0) ? 1 : 2;
  }

  /// Woodcock tracking with weights: at a tentative collision under the majorant σ̄ the path scatters with probability
  /// q = σs/(σs + σn), σn = σ̄ − σt, and goes on otherwise; either way its weight is (σs + σn)/σ̄ = 1 − σa/σ̄, so that
  /// absorption dims paths and never kills them (Raab, Seibert & Keller 2006; Galtier et al. 2013). Channels share σ̄,
  /// so their mixture needs no more than q = β·σs / β·(σs + σn). Emission adds σa Le/σ̄ at every tentative collision.
  std::optional<float> fly_grid(const Medium& medium, float t_max) {
    const bool scatters = medium.scatters() && may_scatter();
    if (!scatters && !medium.emits()) {
      beta_ *= estimate_transmittance(medium, ray_, t_max, flight_, count_);
      ended_ = is_black(beta_);
      return std::nullopt;
    }
    TentativeCollisions collisions(medium, ray_, t_max, flight_, medium.emits() ? emission_rate(medium, t_max) : 0);
    while (collisions.next()) {
      ++count_.medium_lookups;
      const float majorant = collisions.majorant(), inverse = 1 / majorant;
      const MediumPoint m = medium.at(ray_.at(collisions.t()));
      if (medium.emits()) add(m.emission * inverse);
      Rgb sigma_n = Rgb(majorant) - m.sigma_t;
      for (int c = 0; c < 3; ++c) {
        if (sigma_n[c] < 0) {
          // Rounding of the interpolation is no violation; the bound carries an allowance for it.
          if (sigma_n[c] < -1e-4f * majorant) ++count_.majorant_violations;
          sigma_n[c] = 0;
        }
      }
      const Rgb sigma_s = scatters ? m.sigma_s : Rgb(0);
      const float sum = glm::dot(beta_, sigma_s + sigma_n);
      if (!(sum > 0)) {
        // Every channel that still carries light is absorbed here.
        ended_ = true;
        return std::nullopt;
      }
      const float q = glm::dot(beta_, sigma_s) / sum;
      const bool real = scatters && flight_.uniform() < q;
      beta_ *= (real ? sigma_s : sigma_n) * (inverse / (real ? q : 1 - q));
      if (real) return collisions.t();
    }
    return std::nullopt;
  }

  /// The point at t, which lies before the hit. Rounding may put a point next to a boundary on it or beyond, and a path
  /// that went on from there would take the medium to be endless: such a point goes to the near side.
  Vec3 before_boundary(float t, const Hit& hit) const {
    const Vec3 p = ray_.at(t);
    constexpr double kNear = 1e-3;  // farther away rounding matters only to rays that graze at less than 1e-4
    if (hit.t - static_cast<double>(t) > kNear * (static_cast<double>(max_component(glm::abs(p))) + hit.t)) return p;
    const SurfacePoint s = world_.geometry.surface(hit, ray_);
    const Vec3 towards_us = glm::dot(ray_.d, s.ng) < 0 ? s.ng : -s.ng;
    if (glm::dot(p - s.p, towards_us) > 2 * glm::dot(glm::abs(s.ng), s.p_error)) return p;
    return offset_origin(s, -ray_.d);
  }

  bool scatter_in_medium(float t, Vec3 p) {
    const Medium& medium = world_.media[medium_];
    travelled_ += t;
    if (!first_seen_) see_first(albedo(medium, p), Vec3(0));
    next_vertex();
    const PhaseMix phase = medium.phase_at(p);
    const Vec3 wo = -ray_.d;

    sample_light(p, [&](Vec3 wi, Rgb& value, float& pdf, Ray& shadow, int& shadow_medium) {
      value = phase.eval(wo, wi);
      pdf = phase.pdf(wo, wi);
      shadow = {p, wi, ray_.time};
      shadow_medium = medium_;
    });

    Stream direction = stream(key_, vertex_, Purpose::kDirection);
    const Vec2 u = direction.uniform2();
    const auto sample = phase.sample(wo, u, direction.uniform());
    beta_ *= sample.weight;
    ray_ = {p, sample.wi, ray_.time};
    direction_pdf_ = sample.pdf;
    after_scattering(p);
    return survives_roulette();
  }

  /// Handles a hit. False ends the path.
  bool meet_surface(const Hit& hit) {
    const SurfacePoint s = world_.geometry.surface(hit, ray_);
    const SurfaceInfo& info = world_.surfaces[static_cast<size_t>(hit.shape)];
    const TextureContext context{s.uv, s.p};
    if (info.has_alpha && crossing_.uniform() >= world_.textures.eval(info.alpha, context)) {
      ray_.o = offset_origin(s, ray_.d);
      return true;
    }
    if (info.light != kNone) add_emission(hit, s, info.light);
    std::optional<Bsdf> bsdf;
    int material = info.material;
    if (!info.is_interface) {
      material = world_.materials.resolve(material, context, crossing_);
      bsdf = world_.materials.bsdf(material, context, crossing_);
    }
    if (!bsdf) {
      medium_ = world_.medium_after(info, s.ng, ray_.d, medium_);
      ray_.o = offset_origin(s, ray_.d);
      return true;
    }
    const Vec3 ns = world_.materials.shading_normal(material, context, {s.ns, s.dpdu, s.dpdv});
    const Frame frame = shading_frame(ns, s.dpdu);
    const Vec3 wo = frame.to_local(-ray_.d);
    if (!first_seen_) see_first(albedo(*bsdf, wo), ns);
    if (!may_scatter()) return false;
    next_vertex();

    Stream layered = stream(key_, vertex_, Purpose::kLayered);
    if (!is_specular(*bsdf)) {
      sample_light(s.p, [&](Vec3 wi, Rgb& value, float& pdf, Ray& shadow, int& shadow_medium) {
        const Vec3 local = frame.to_local(wi);
        value = eval(*bsdf, wo, local, layered);
        pdf = woodcock::pdf(*bsdf, wo, local);
        shadow = {offset_origin(s, wi), wi, ray_.time};
        shadow_medium = world_.medium_after(info, s.ng, wi, medium_);
      });
    }

    Stream direction = stream(key_, vertex_, Purpose::kDirection);
    const auto sample = woodcock::sample(*bsdf, wo, direction, layered);
    if (!sample) return false;
    beta_ *= sample->weight;
    if (is_black(beta_)) return false;
    if (sample->transmission) eta_scale_ *= sample->eta * sample->eta;
    const Vec3 wi = glm::normalize(frame.to_world(sample->wi));
    medium_ = world_.medium_after(info, s.ng, wi, medium_);
    ray_ = {offset_origin(s, wi), wi, ray_.time};
    direction_pdf_ = sample->specular ? 0 : sample->pdf;
    after_scattering(s.p);
    return survives_roulette();
  }

  /// Next-event estimation: one light, chosen by power. `evaluate` gives f·|cos| and the pdf of sampling the
  /// direction by scattering, and the shadow ray with its medium.
  template <typename Evaluate>
  void sample_light(Vec3 reference, Evaluate&& evaluate) {
    const auto choice = world_.lights.choose(stream(key_, vertex_, Purpose::kLightChoice).uniform());
    if (!choice) return;
    Stream random = stream(key_, vertex_, Purpose::kLightSample);
    const Vec2 u = random.uniform2();
    const auto light = world_.lights.sample(choice->light, reference, u, random.uniform());
    if (!light || is_black(light->radiance)) return;
    Rgb value{0};
    float scattering_pdf = 0;
    Ray shadow;
    int shadow_medium = kNone;
    evaluate(light->wi, value, scattering_pdf, shadow, shadow_medium);
    if (is_black(value)) return;
    float distance = light->distance;
    if (std::isfinite(distance)) {
      // The ray starts at the offset origin, so it is aimed anew.
      const Vec3 target = light->shape != kNone ? light->p : reference + light->wi * distance;
      const Vec3 to = target - shadow.o;
      distance = glm::length(to);
      if (!(distance > 0)) return;
      shadow.d = to / distance;
    }
    Stream tracking = stream(key_, vertex_, Purpose::kTransmittance);
    const Rgb transmittance =
        shadow_transmittance(world_, shadow, distance, shadow_medium, {light->shape, light->primitive}, tracking, count_);
    if (is_black(transmittance)) return;
    const float light_pdf = choice->pmf * light->pdf;
    const float mis = light->delta ? 1 : mis_weight(light_pdf, scattering_pdf);
    add(value * light->radiance * transmittance * (mis / light_pdf));
  }

  void add_emission(const Hit& hit, const SurfacePoint& s, int light) {
    const EmitterHit emitter{s.p, s.ng, s.uv, hit.primitive};
    const Rgb radiance = world_.lights.emitted(light, emitter, -ray_.d);
    if (is_black(radiance)) return;
    float mis = 1;
    if (direction_pdf_ > 0)
      mis = mis_weight(direction_pdf_, world_.lights.pmf(light) * world_.lights.pdf(light, reference_, emitter, ray_.d));
    add(radiance * mis);
  }

  void add_environment() {
    if (!world_.lights.has_environment()) return;
    float mis = 1;
    if (direction_pdf_ > 0) mis = mis_weight(direction_pdf_, world_.lights.environment_pdf(ray_.d));
    add(world_.lights.environment(ray_.d) * mis);
  }

  void see_first(Rgb albedo, Vec3 normal) {
    first_seen_ = true;
    result_.albedo = albedo;
    result_.normal = normal;
    result_.depth = static_cast<float>(travelled_ / world_.space.scale);
  }

  void next_vertex() {
    ++vertex_;
    ++depth_;
    if ((++count_.vertices & (kReportEvery - 1)) == 0 && settings_.watch != nullptr) report();
  }

  /// Long paths move the counter and can be stopped.
  void report() {
    settings_.watch->vertices.fetch_add(kReportEvery, std::memory_order_relaxed);
    stopped_ = settings_.watch->cancel.load(std::memory_order_relaxed);
  }

  void after_scattering(Vec3 at) {
    reference_ = at;
    travelled_ = 0;
    begin_segment();
  }

  /// Russian roulette on the throughput relative to what refraction alone does to radiance (η²).
  bool survives_roulette() {
    if (stopped_) return false;
    if (depth_ < 2) return true;
    const float q = max_component(beta_) * eta_scale_;
    if (q >= 1) return true;
    if (!(q > 0) || stream(key_, vertex_, Purpose::kRoulette).uniform() >= q) return false;
    beta_ /= q;
    return true;
  }

  const World& world_;
  const PathSettings& settings_;
  PathCounters& count_;
  const PathKey key_;
  PathResult result_;

  Ray ray_;
  int medium_;
  Stream flight_, channel_, crossing_;
  Rgb beta_{1};
  int depth_ = 0;
  uint32_t vertex_ = 0;
  float eta_scale_ = 1;
  /// Of the last scattering: the point it happened at and the pdf of the direction, 0 where light sampling could not
  /// have given it (camera, specular).
  Vec3 reference_{0};
  float direction_pdf_ = 0;
  double travelled_ = 0;  ///< since the last scattering, render units
  bool first_seen_ = false;
  bool ended_ = false;
  bool stopped_ = false;
};

}  // namespace

PathResult trace_path(const World& world, const PathSettings& settings, Ray ray, PathKey key, PathCounters& count) {
  ++count.paths;
  return Path(world, settings, ray, key, count).run();
}

CameraSample camera_sample(const World& world, PathKey key, int x, int y) {
  Stream film = stream(key, 0, Purpose::kPixelFilter);
  const auto filtered = world.filter.sample(film.uniform2());
  Stream lens = stream(key, 0, Purpose::kLens);
  Stream time = stream(key, 0, Purpose::kTime);
  const DVec2 position = DVec2(x + 0.5, y + 0.5) + filtered.offset;
  return {world.camera.ray(position, lens.uniform2(), time.uniform()), filtered.weight};
}

}  // namespace woodcock
