#include "renderer/materials/layered.h"

#include <algorithm>
#include <cmath>

#include "renderer/materials/fresnel.h"
#include "renderer/materials/layered_closed_forms.h"
#include "renderer/media/henyey_greenstein.h"

namespace woodcock {

namespace {

float transmittance(float depth, Vec3 w) { return depth > 0 ? std::exp(-depth / abs_cos(w)) : 1; }

float power_heuristic(float p, float q) { return p > 0 ? (p / q > 1e18f ? 1 : p * p / (p * p + q * q)) : 0; }

/// Russian roulette after a few scatterings; false ends the walk.
bool survives(Rgb& beta, int depth, Stream& rng) {
  const float q = max_component(beta);
  if (depth <= 3 || q >= 0.25f) return true;
  if (!(rng.uniform() < q)) return false;
  beta /= q;
  return true;
}

/// The height z ∈ [0, thickness] of a walk and its direction of travel; travels to the next event.
struct Walk {
  Vec3 w;
  float z;
  Rgb beta;

  enum class Event { kBase, kBoundary, kMedium, kNone };
  Event advance(const Coat& coat, Stream& rng) {
    if (w.z == 0) return Event::kNone;
    if (coat.scatters()) {
      const float step = rng.exponential() * abs_cos(w), next = w.z > 0 ? z + step : z - step;
      if (next > 0 && next < coat.thickness) {
        z = next;
        return Event::kMedium;
      }
      z = w.z > 0 ? coat.thickness : 0;
    } else {
      // Every flight crosses the whole layer, since nothing turns it inside.
      beta *= transmittance(coat.thickness, w);
      z = w.z > 0 ? coat.thickness : 0;
    }
    return w.z > 0 ? Event::kBoundary : Event::kBase;
  }
};

/// The factor of a specular reflection at the base.
Rgb mirror_reflectance(const ConductorBsdf& base, Vec3 w) { return fresnel_conductor(abs_cos(w), base.eta, base.k); }
Rgb mirror_reflectance(const DiffuseBsdf&, Vec3) { return Rgb(0); }

/// wo and wi both above the surface.
template <typename Base>
Rgb walk_value(const Coat& coat, const Base& base, Vec3 wo, Vec3 wi, Stream& rng) {
  const std::optional<BsdfSample> enter = sample(coat.boundary, wo, rng, Lobes::kTransmission);
  // From wi inwards, as importance: then f(−w, wi) of leaving is what was sampled here, read backwards.
  const std::optional<BsdfSample> leave = sample(coat.boundary, wi, rng, Lobes::kTransmission, Transport::kImportance);
  if (!enter || !leave || leave->wi.z == 0) return Rgb(0);
  const Vec3 out = -leave->wi;  // direction of travel towards the boundary that refracts into wi
  const Rgb leave_factor = leave->weight * (abs_cos(wi) / abs_cos(out));
  const bool delta_boundary = coat.boundary.delta(), delta_base = is_specular(base);

  const HenyeyGreenstein phase{coat.g};
  Rgb f(0);
  Walk walk{enter->wi, coat.thickness, enter->weight};
  // What the walk's own direction of travel, drawn with density p, contributes by leaving along wi.
  const auto leave_along_walk = [&](float p, bool delta) {
    if (delta_boundary || walk.w.z <= 0) return;
    const Rgb value = eval(coat.boundary, -walk.w, wi);
    if (is_black(value)) return;
    const float weight = delta ? 1 : power_heuristic(p, pdf(coat.boundary, wi, -walk.w, Lobes::kTransmission));
    f += walk.beta * value * (weight * transmittance(coat.thickness - walk.z, walk.w));
  };
  // What joining the vertex to `out` contributes; `value` includes the cosine, p is the density of the walk itself.
  const auto leave_by_connection = [&](Rgb value, float p) {
    const float weight = delta_boundary ? 1 : power_heuristic(leave->pdf, p);
    f += walk.beta * value * leave_factor * (weight * transmittance(coat.thickness - walk.z, out));
  };

  // Between a mirror and a smooth boundary, light scattered in the medium may leave after any number of specular
  // reflections, which neither of the above can join. `out` has one cosine all along, so the chains are a sum over their
  // number k, told backwards from the exit: base, boundary, base, …. (pbrt-v4's f leaves these paths out, its
  // sampling does not; they are needed for the two to agree.)
  const auto leave_by_mirrors = [&](int scatterings) {
    const Rgb base_factor = mirror_reflectance(base, out);
    const float boundary_factor = fresnel_dielectric(abs_cos(out), 1 / coat.boundary.eta), crossing = transmittance(coat.thickness, out);
    Rgb chain = walk.beta * leave_factor;
    for (int k = 1; scatterings + k <= coat.max_depth && !is_black(chain); ++k) {
      const bool downwards = k % 2 == 1;
      chain *= (downwards ? base_factor : Rgb(boundary_factor)) * crossing;
      const Vec3 first = downwards ? -mirror(out) : out;
      f += chain * (phase.eval(-walk.w, first) * transmittance(downwards ? walk.z : coat.thickness - walk.z, out));
    }
  };

  for (int depth = 0; depth < coat.max_depth && survives(walk.beta, depth, rng); ++depth) {
    const Walk::Event event = walk.advance(coat, rng);
    if (event == Walk::Event::kMedium) {
      const float p = phase.eval(-walk.w, out);
      walk.beta *= coat.albedo;
      leave_by_connection(Rgb(p), p);
      if (delta_boundary && delta_base) leave_by_mirrors(depth + 1);
      const PhaseSample next = phase.sample(-walk.w, rng.uniform2());
      walk.w = glm::normalize(next.wi);
      leave_along_walk(next.pdf, false);
    } else if (event == Walk::Event::kBase) {
      if (!delta_base) leave_by_connection(eval(base, -walk.w, out), pdf(base, -walk.w, out));
      const std::optional<BsdfSample> s = sample(base, -walk.w, rng);
      if (!s) break;
      walk.beta *= s->weight;
      walk.w = s->wi;
      leave_along_walk(s->pdf, s->specular);
    } else if (event == Walk::Event::kBoundary) {
      const std::optional<BsdfSample> s = sample(coat.boundary, -walk.w, rng, Lobes::kReflection);
      if (!s) break;
      walk.beta *= s->weight;
      walk.w = s->wi;
    } else {
      break;
    }
  }
  return f;
}

template <typename Base>
Rgb eval_layered(const Coat& coat, const Base& base, Vec3 wo, Vec3 wi, Stream& rng) {
  if (!same_hemisphere(wo, wi)) return Rgb(0);
  if (wo.z < 0) wo = -wo, wi = -wi;
  const Rgb coat_only = eval(coat.boundary, wo, wi);
  if (coat.boundary.delta() && is_specular(base) && !coat.scatters()) return coat_only;
  Rgb sum(0);
  for (int i = 0; i < coat.samples; ++i) sum += walk_value(coat, base, wo, wi, rng);
  return coat_only + sum / static_cast<float>(coat.samples);
}

/// `density` is the proxy of the model, (wo, wi) → 1/sr.
template <typename Base, typename Density>
std::optional<BsdfSample> sample_layered(const Coat& coat, const Base& base, Vec3 wo, Stream& direction, Stream& rng, Density&& density) {
  const float side = std::copysign(1.0f, wo.z);
  wo *= side;
  const auto finish = [&](Vec3 wi, Rgb weight, bool specular) -> std::optional<BsdfSample> {
    BsdfSample s;
    s.wi = side * wi;
    s.weight = weight;
    s.specular = specular;
    s.pdf = specular ? 0 : density(wo, wi);
    if (!specular && !(s.pdf > 0)) return std::nullopt;
    return s;
  };
  const std::optional<BsdfSample> enter = sample(coat.boundary, wo, direction);
  if (!enter) return std::nullopt;
  if (!enter->transmission) return finish(enter->wi, enter->weight, enter->specular);

  Walk walk{enter->wi, coat.thickness, enter->weight};
  bool specular = enter->specular;
  for (int depth = 0; survives(walk.beta, depth, rng); ++depth) {
    const Walk::Event event = walk.advance(coat, rng);
    if (event == Walk::Event::kNone) return std::nullopt;
    std::optional<BsdfSample> s;
    if (event == Walk::Event::kBoundary) {
      s = sample(coat.boundary, -walk.w, rng);
      if (s && s->transmission) return finish(s->wi, walk.beta * s->weight, specular && s->specular);
    }
    if (depth >= coat.max_depth) return std::nullopt;
    if (event == Walk::Event::kMedium) {
      walk.beta *= coat.albedo;
      walk.w = glm::normalize(HenyeyGreenstein{coat.g}.sample(-walk.w, rng.uniform2()).wi);
      specular = false;
      continue;
    }
    if (event == Walk::Event::kBase) s = sample(base, -walk.w, rng);
    if (!s) return std::nullopt;
    walk.beta *= s->weight;
    walk.w = s->wi;
    specular = specular && s->specular;
  }
  return std::nullopt;
}

/// Density of what comes back from below the coat: the share of light that enters, times `below`.
float mix_density(const Coat& coat, Vec3 wo, Vec3 wi, float below) {
  return pdf(coat.boundary, wo, wi) + (1 - fresnel_dielectric(abs_cos(wo), coat.boundary.eta)) * below;
}

/// The metal's lobe as it looks from outside, where refraction widens it by about eta and the coat's own roughness
/// blurs it, over a broad lobe for what bounced often.
float density_below(const CoatedConductorBsdf& b, Vec3 wo, Vec3 wi) {
  const float cosine = kInvPi * abs_cos(wi);
  const Ggx &coat = b.coat.boundary.roughness, &metal = b.base.roughness;
  const float eta = b.coat.boundary.eta;
  const Ggx seen = Ggx::from_alpha(std::hypot(coat.alpha_x, eta * metal.alpha_x), std::hypot(coat.alpha_y, eta * metal.alpha_y));
  if (seen.smooth()) return cosine;
  const float broad = b.coat.scatters() ? 0.5f : 0.15f;
  return broad * cosine + (1 - broad) * pdf(ConductorBsdf{Rgb(0), Rgb(0), seen}, wo, wi);
}

template <typename Coated>
Rgb albedo_layered(const Coated& b, Vec3 wo) {
  const float r = fresnel_dielectric(abs_cos(wo), b.coat.boundary.eta);
  return Rgb(r) + (1 - r) * albedo(b.base, wo);
}

}  // namespace

Rgb eval(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi, Stream& layered) {
  if (b.closed_form()) return eval_closed_form(b, wo, wi);
  return eval_layered(b.coat, b.base, wo, wi, layered);
}
float pdf(const CoatedDiffuseBsdf& b, Vec3 wo, Vec3 wi) {
  if (b.closed_form()) return pdf_closed_form(b, wo, wi);
  return same_hemisphere(wo, wi) ? mix_density(b.coat, wo.z < 0 ? -wo : wo, wo.z < 0 ? -wi : wi, kInvPi * abs_cos(wi)) : 0;
}
std::optional<BsdfSample> sample(const CoatedDiffuseBsdf& b, Vec3 wo, Stream& direction, Stream& layered) {
  if (b.closed_form()) return sample_closed_form(b, wo, direction);
  return sample_layered(b.coat, b.base, wo, direction, layered, [&](Vec3 o, Vec3 i) { return pdf(b, o, i); });
}
Rgb albedo(const CoatedDiffuseBsdf& b, Vec3 wo) { return b.closed_form() ? albedo_closed_form(b, wo) : albedo_layered(b, wo); }

Rgb eval(const CoatedConductorBsdf& b, Vec3 wo, Vec3 wi, Stream& layered) { return eval_layered(b.coat, b.base, wo, wi, layered); }
float pdf(const CoatedConductorBsdf& b, Vec3 wo, Vec3 wi) {
  if (!same_hemisphere(wo, wi) || is_specular(b)) return 0;
  if (wo.z < 0) wo = -wo, wi = -wi;
  return mix_density(b.coat, wo, wi, density_below(b, wo, wi));
}
std::optional<BsdfSample> sample(const CoatedConductorBsdf& b, Vec3 wo, Stream& direction, Stream& layered) {
  if (b.closed_form()) return sample_closed_form(b, wo);
  return sample_layered(b.coat, b.base, wo, direction, layered, [&](Vec3 o, Vec3 i) { return pdf(b, o, i); });
}
Rgb albedo(const CoatedConductorBsdf& b, Vec3 wo) { return b.closed_form() ? albedo_closed_form(b, wo) : albedo_layered(b, wo); }

}  // namespace woodcock
