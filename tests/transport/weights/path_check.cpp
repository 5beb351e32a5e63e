#include "tests/transport/weights/path_check.h"

#include <fmt/format.h>

#include <cmath>
#include <numbers>
#include <utility>

#include "tests/transport/weights/rounding.h"

namespace woodcock::testing {
namespace {

constexpr const char* kNames[] = {"scattering",   "environment", "collision",       "segment",
                                  "light sample", "equiangular", "emission sample", "refracted sample"};

constexpr size_t kMaxFailures = 8;

std::string text(DVec3 v) { return fmt::format("({:.7g} {:.7g} {:.7g})", v.x, v.y, v.z); }

double chosen(Technique technique, const Densities& d) {
  switch (technique) {
    case Technique::kLightSample:
      return d.light_sample;
    case Technique::kEquiangular:
      return d.equiangular;
    case Technique::kEmissionSample:
      return d.emission_sample;
    case Technique::kRefractedSample:
      return d.refracted_sample;
    default:
      return d.scattering;
  }
}

}  // namespace

int64_t CheckReport::total() const {
  int64_t sum = 0;
  for (const int64_t n : contributions) sum += n;
  return sum;
}

void CheckReport::add(const CheckReport& o) {
  for (size_t i = 0; i < kTechniques; ++i) contributions[i] += o.contributions[i];
  too_near += o.too_near;
  with_several += o.with_several;
  exact_values += o.exact_values;
  branches += o.branches;
  shared += o.shared;
  light_roulettes += o.light_roulettes;
  steps += o.steps;
  weight_deviation = std::max(weight_deviation, o.weight_deviation);
  sum_deviation = std::max(sum_deviation, o.sum_deviation);
  density_deviation = std::max(density_deviation, o.density_deviation);
  value_deviation = std::max(value_deviation, o.value_deviation);
  worst = std::max(worst, o.worst);
  failed += o.failed;
  failed_weights += o.failed_weights;
  for (const std::string& f : o.failures)
    if (failures.size() < kMaxFailures) failures.push_back(f);
}

PathCheck::PathCheck(const SceneFormulas& scene, const PathSettings& settings, uint32_t effects)
    : scene_(scene), settings_(settings), techniques_(effects, settings) {}

void PathCheck::check(const PathRecord& record, const std::string& name, CheckReport& report) {
  name_ = name;
  report_ = &report;
  static_cast<PathState&>(*this) = {};
  parts_ = 0;
  fork_.reset();
  for (const PathEvent& event : record) {
    added_ = std::get_if<LightAdded>(&event);
    try {
      // The part before may have ended there.
      if (!std::holds_alternative<RouletteSurvived>(event) && !std::holds_alternative<SplitPart>(event)) settle_roulette();
      std::visit([&](const auto& e) { see(e); }, event);
    } catch (const TooNear&) {
      ++report.too_near;
    }
  }
  if (directions_ != 1 && parts_ != directions_) fail(fmt::format("{} parts of a path that splits in {}", parts_, directions_));
}

void PathCheck::fail(const std::string& what) {
  ++report_->failed;
  if (report_->failures.size() >= kMaxFailures) return;
  report_->failures.push_back(name_ + ": " + what);
  if (added_ != nullptr)
    report_->failures.back() += fmt::format(" ({} {}, from {} to {} along {})", kNames[static_cast<size_t>(added_->technique)],
                                            added_->source, text(added_->from), text(added_->p), text(added_->wi));
}

void PathCheck::compare(const char* what, double found, double expected, double allowed, double* deviation) {
  compare(what, DVec3(found), DVec3(expected), allowed, deviation);
}

void PathCheck::compare(const char* what, DVec3 found, DVec3 expected, double allowed, double* deviation) {
  // Below what a float can hold nothing is compared.
  const double size = std::max({largest(found), largest(expected), 1e-30});
  const double off = largest(found - expected) / size;
  // Near a light or along a surface rounding allows more, which says little about the rest.
  if (deviation != nullptr && off <= allowed && allowed < 1e-3) *deviation = std::max(*deviation, off);
  if (off <= allowed) {
    report_->worst = std::max(report_->worst, off / allowed);
    return;
  }
  fail(fmt::format("{} is {}, expected {}, off by {:.3g} where rounding allows {:.3g}, after {} scatterings", what, text(found),
                   text(expected), off, allowed, scatterings_));
}

// --- the path itself -------------------------------------------------------------------------------------

void PathCheck::see(const PathStarts& e) {
  // Without the mixture of channels a path follows one of three.
  if (e.beta != DVec3(1)) {
    const bool one = !has(Feature::kChannelMixture) && e.beta.x + e.beta.y + e.beta.z == 3 && largest(e.beta) == 3;
    if (!one) fail("the path starts with a throughput of " + text(e.beta));
    so_far_.f = e.beta / 3.0;
    so_far_.p = 1.0 / 3;
  }
  recorded_beta_ = e.beta;
}

void PathCheck::see(const SegmentStarts& e) {
  ++report_->steps;
  segment_ = e;
  compare("the throughput at the start of a segment", e.beta, so_far_.beta(), so_far_.slack);
  // The recorded one, just compared: what tables may be off is judged once.
  const DVec3 size = glm::abs(DVec3(e.beta));
  share_ = size / (size.x + size.y + size.z);
  const double middle = std::isfinite(e.t_max) ? e.t_max / 2 : 1e3;
  if (const auto medium = scene_.medium_at(e.o + middle * e.d, 1e-5); medium && e.t_max > 1e-4 && *medium != e.medium)
    fail(fmt::format("the segment's medium is {}, expected {}", e.medium, *medium));
}

void PathCheck::see(const SegmentEnds& e) {
  ++report_->steps;
  const MediumFormula& medium = scene_.medium(segment_.medium);
  const double length = e.t.value_or(segment_.t_max);
  // Branches end where their medium does.
  if (!e.t) next_light_share_ = 1;
  if (!is_closed(medium, segment_.t_max)) {
    // Tracked: the recorded estimate stands for the ratio of value and density.
    for (int c = 0; c < 3; ++c) so_far_.f[c] *= segment_.beta[c] != 0 ? e.beta[c] / segment_.beta[c] : 0;
    recorded_beta_ = e.beta;
    return;
  }
  const DVec3 sigma = medium.sigma_t(segment_.o), through = glm::exp(-sigma * std::min(length, 1e30));
  if (!medium.scatters() || !may_scatter()) {
    so_far_.f *= through;
  } else if (e.t) {
    so_far_.f *= medium.sigma_s(segment_.o) * through;
    so_far_.p *= flight_pdf(medium, share_, segment_.o, length);
  } else {
    so_far_.f *= through;
    so_far_.p *= glm::dot(share_, through);
  }
  so_far_.slack += 1e-6 * (1 + largest(sigma) * std::min(length, 1e6));
  compare("the throughput after a segment", e.beta, so_far_.beta(), so_far_.slack);
  recorded_beta_ = e.beta;
}

void PathCheck::see(const MediumScatters& e) {
  refraction_.reset();
  vertex_ = {.kind = LastVertex::Kind::kMedium, .p = e.p, .wo = e.wo, .scatterings_before = scatterings_, .medium = e.medium};
  vertex_.o = segment_.o;
  vertex_.d = segment_.d;
  vertex_.t = e.t;
  vertex_.t_max = segment_.t_max;
  vertex_.share = share_;
  ++scatterings_;
  light_share_ = std::exchange(next_light_share_, 1.0);
  share_slack_ = std::exchange(next_slack_, 0.0);
  branch_.reset();
  report_->branches += fork_.has_value();
}

void PathCheck::see(const SurfaceScatters& e) {
  if (!may_scatter()) return;
  refraction_.reset();
  if (vertex_.kind != LastVertex::Kind::kCamera && !by_delta_lobe_) refraction_ = Refraction{vertex_, wi_};
  vertex_ = {.kind = LastVertex::Kind::kSurface, .p = e.p, .wo = e.wo, .scatterings_before = scatterings_, .material = e.material};
  vertex_.closed_forms = has(Feature::kLayeredClosedForms);
  vertex_.z = glm::normalize(e.ns);
  const DVec3 along = e.dpdu - vertex_.z * glm::dot(e.dpdu, vertex_.z);
  const DVec3 any = std::abs(vertex_.z.x) < 0.5 ? DVec3(1, 0, 0) : DVec3(0, 1, 0);
  vertex_.x = glm::dot(along, along) > 0 ? glm::normalize(along) : glm::normalize(glm::cross(vertex_.z, any));
  vertex_.y = glm::cross(vertex_.z, vertex_.x);
  ++scatterings_;
  light_share_ = next_light_share_ = 1;
  share_slack_ = next_slack_ = 0;
  branch_.reset();
}

void PathCheck::see(const DirectionTaken& e) {
  ++report_->steps;
  wi_ = e.wi;
  by_delta_lobe_ = e.pdf == 0;
  const Throughput before = so_far_;
  // Only a transmission by a delta lobe is a refraction.
  if (!by_delta_lobe_ || glm::dot(vertex_.z, vertex_.wo) * glm::dot(vertex_.z, e.wi) > 0) refraction_.reset();
  if (vertex_.kind == LastVertex::Kind::kSurface) {
    const MaterialKind& material = scene_.material(vertex_.material);
    const DVec3 wo = vertex_.local(vertex_.wo), wi = vertex_.local(e.wi);
    const bool layered = is_by_walks(material, vertex_.closed_forms);
    if (!layered && !is_mixed(material, vertex_.closed_forms) && by_delta_lobe_ != is_delta(material))
      fail("a delta lobe is taken for another or another for one");
    const double eta = index_ratio(material, wo, wi);
    eta_scale_ *= eta * eta;
    if (layered) {
      for (int c = 0; c < 3; ++c) so_far_.f[c] *= recorded_beta_[c] != 0 ? e.beta[c] / recorded_beta_[c] : 0;
    } else if (by_delta_lobe_) {
      so_far_.f *= delta_factor(material, wo, wi);
    }
  }
  if (!by_delta_lobe_) {
    const double pdf = scattering_pdf(scene_, vertex_, e.wi);
    const std::optional<DVec3> value = scattering_value(scene_, vertex_, e.wi);
    const double tolerance = scattering_tolerance(scene_, vertex_, e.wi);
    double pdf_allowed = 3e-5 + tolerance, ratio_allowed = 3e-5 + tolerance;
    for (int way = 0; way < 4; ++way) {
      LastVertex v = vertex_;
      LightEnd end;
      end.wi = e.wi;
      nudge(way, v, end);
      const double other = scattering_pdf(scene_, v, end.wi);
      pdf_allowed += 2 * std::abs(other / pdf - 1);
      if (value)
        ratio_allowed += 2 * largest(scattering_value(scene_, v, end.wi).value_or(DVec3(0)) / other - *value / pdf) / largest(*value / pdf);
    }
    compare("the density of the direction", e.pdf, pdf, pdf_allowed, &report_->density_deviation);
    if (value) {
      so_far_.f *= *value;
      so_far_.p *= pdf;
      so_far_.slack += ratio_allowed;
    }
    if (branch_) {
      next_light_share_ = light_share(vertex_, e.wi);
      next_slack_ = 4e-5;
      for (int way = 0; way < 4; ++way) {
        LastVertex v = vertex_;
        LightEnd end;
        end.wi = e.wi;
        nudge(way, v, end);
        next_slack_ += 2 * std::abs(light_share(v, end.wi) / next_light_share_ - 1);
      }
    }
  }
  so_far_.slack += 1e-5;
  compare("the throughput after a scattering", e.beta, so_far_.beta(), so_far_.slack);
  // The difference is judged once; what follows is judged from here.
  if (largest(before.beta()) > 0) recorded_beta_ = e.beta;
  survival_ = 4 * largest(so_far_.beta()) * directions_ * eta_scale_;  // a path that carries a quarter goes on
  roulette_due_ = scatterings_ >= 2 && has(Feature::kRoulette) && survival_ < 1;
}

void PathCheck::see(const RouletteSurvived& e) {
  ++report_->steps;
  if (scatterings_ < 2 || !has(Feature::kRoulette)) fail("a roulette where there is none");
  compare("the probability to survive the roulette", e.q, std::min(survival_, 1.0), so_far_.slack);
  so_far_.p *= std::min(survival_, 1.0);
  roulette_due_ = false;
  recorded_beta_ = e.beta;
}

void PathCheck::settle_roulette() {
  if (roulette_due_ && survival_ < 1 - so_far_.slack) fail(fmt::format("no roulette where the path survives with {:.6g}", survival_));
  roulette_due_ = false;
}

// --- what it adds ----------------------------------------------------------------------------------------

void PathCheck::see(const LightAdded& e) {
  ++report_->contributions[static_cast<size_t>(e.technique)];
  if (e.technique == Technique::kSegment) {
    const MediumFormula& medium = scene_.medium(segment_.medium);
    const DVec3 j = medium.emission(segment_.o), sigma = medium.sigma_t(segment_.o);
    DVec3 emitted;
    for (int c = 0; c < 3; ++c) emitted[c] = sigma[c] > 0 ? j[c] * -std::expm1(-sigma[c] * std::min(e.length, 1e30)) / sigma[c] : 0;
    compare("the emission of a segment", e.added, so_far_.beta() * emitted, so_far_.slack, &report_->value_deviation);
    return;
  }
  LastVertex vertex = vertex_;
  LightEnd end{.source = e.source, .primitive = e.primitive, .p = e.p, .wi = e.wi};
  switch (e.technique) {
    case Technique::kEnvironment:
      end.kind = LightEnd::Kind::kEnvironment;
      break;
    case Technique::kCollision:
    case Technique::kEmissionSample:
      end.kind = LightEnd::Kind::kEmission;
      break;
    case Technique::kEquiangular:
      vertex = {
          .kind = LastVertex::Kind::kMedium, .p = e.from, .wo = -segment_.d, .scatterings_before = scatterings_, .medium = segment_.medium};
      vertex.o = segment_.o;
      vertex.d = segment_.d;
      vertex.t = e.t;
      vertex.t_max = segment_.t_max;
      vertex.share = share_;
      if (!may_scatter() || !(e.t < segment_.t_max)) fail("equiangular sampling where no path may scatter");
      break;
    case Technique::kLightSample:
      if (scene_.light(e.source).is_infinite()) end.kind = LightEnd::Kind::kEnvironment;
      break;
    default:
      break;
  }
  const bool by_scattering = chosen(e.technique, {1, 0, 0, 0, 0}) == 1;
  end.refracted = e.technique == Technique::kRefractedSample;
  end.by_delta_lobe = by_scattering && by_delta_lobe_;
  if (vertex.kind != LastVertex::Kind::kCamera && largest(e.from - vertex.p) > 1e-6 * std::max(1.0, largest(vertex.p)))
    fail("light is added at " + text(e.from) + ", but the last vertex is at " + text(vertex.p));
  if (e.technique == Technique::kScattering && by_delta_lobe_ && refraction_) {
    LightEnd way = end;
    way.by_delta_lobe = false;
    way.refracted = true;
    way.wi = refraction_->wi;
    return check_contribution(e, vertex, end, refraction_->vertex, way);
  }
  check_contribution(e, vertex, end, vertex, end);
}

void PathCheck::check_contribution(const LightAdded& e, const LastVertex& vertex, const LightEnd& end, const LastVertex& origin,
                                   const LightEnd& way_there) {
  const Densities d = densities(scene_, techniques_, origin, way_there), w = d.weights(techniques_.mis);
  const double density = chosen(e.technique, d), weight = chosen(e.technique, w);
  const double tolerance = vertex.kind == LastVertex::Kind::kSurface ? scattering_tolerance(scene_, vertex, end.wi) : 0;
  // A weight of squared densities changes by at most half of what one density does, of a light sample also by its own share.
  double weight_allowed = 1e-9 + (3e-5 + 2 * tolerance) * weight, density_allowed = 3e-5 + tolerance;
  for (int way = 0; way < 4; ++way) {
    LastVertex v = origin;
    LightEnd n = way_there;
    nudge(way, v, n);
    const Densities other = densities(scene_, techniques_, v, n);
    weight_allowed += 4 * std::abs(chosen(e.technique, other.weights(techniques_.mis)) - weight);
    if (density > 0) density_allowed += 4 * std::abs(chosen(e.technique, other) / density - 1);
  }
  const int ways = (d.scattering > 0) + (d.light_sample > 0) + (d.equiangular > 0) + (d.emission_sample > 0) + (d.refracted_sample > 0);
  report_->with_several += ways > 1;
  const std::string name = kNames[static_cast<size_t>(e.technique)];
  const double off = std::abs(e.weight - weight), sum_off = std::abs(w.sum() - weight + e.weight - 1);
  if (!(density > 0)) fail("light by " + name + ", which could not have made this path");
  if (!(off <= weight_allowed && sum_off <= weight_allowed + 1e-12)) {
    ++report_->failed_weights;
    fail(fmt::format(
        "the weight of {} is {:.7g}, expected {:.7g} (the others are {:.7g}, so that they sum to {:.7g}); rounding allows {:.2g}; "
        "after {} scatterings, the last one {}",
        name, e.weight, weight, w.sum() - weight, w.sum() - weight + e.weight, weight_allowed, scatterings_,
        vertex.kind == LastVertex::Kind::kMedium    ? "in a medium"
        : vertex.kind == LastVertex::Kind::kSurface ? "on a surface"
                                                    : "at the camera"));
  } else {
    report_->weight_deviation = std::max(report_->weight_deviation, off);
    report_->sum_deviation = std::max(report_->sum_deviation, sum_off);
    report_->worst = std::max(report_->worst, off / weight_allowed);
  }
  // In the measure that the loop uses: that of the vertex's distance only where it is drawn there.
  const double flown =
      vertex.kind == LastVertex::Kind::kMedium && (e.technique == Technique::kLightSample || e.technique == Technique::kRefractedSample)
          ? flight_pdf(scene_.medium(vertex.medium), vertex.share, vertex.p, vertex.t)
          : 1;
  if (e.density > 0) compare("the density of a sample", e.density, density / flown, density_allowed, &report_->density_deviation);
  check_value(e, vertex, end, density / flown, weight, density_allowed + weight_allowed / std::max(weight, 1e-12));
}

PathCheck::ThroughGlass PathCheck::through_glass(const LastVertex& vertex, const LightEnd& end) const {
  const Body* glass = scene_.glass_around(vertex.p);
  const auto c = glass != nullptr ? cross(*glass, vertex.p, end.wi) : std::nullopt;
  if (!c) throw TooNear{};
  ThroughGlass result;
  const double length = glm::distance(c->v, vertex.p), eta = glass->eta;
  const double s = (eta * c->cos_i - c->cos_t) / (eta * c->cos_i + c->cos_t), p = (c->cos_i - eta * c->cos_t) / (c->cos_i + eta * c->cos_t);
  result.boundary = (1 - 0.5 * (s * s + p * p)) * eta * eta;
  if (glass->inside != kNone && scene_.medium(glass->inside).is_homogeneous() && settings_.plan && has(Feature::kClosedForms) &&
      glass->is_empty) {
    const DVec3 sigma = scene_.medium(glass->inside).sigma_t(vertex.p);
    result.survival = std::min(1.0, 4 * std::exp(-std::min({sigma.x, sigma.y, sigma.z}) * length));
  }
  const auto inside = scene_.way(vertex.p, end.wi, length), outside = scene_.way(c->v, c->wo, glm::distance(end.p, c->v));
  if (inside && outside) {
    result.transmittance = inside->transmittance * outside->transmittance;
    result.depth = inside->depth + outside->depth;
  }
  return result;
}

/// f/p · w.
void PathCheck::check_value(const LightAdded& e, const LastVertex& vertex, const LightEnd& end, double density, double weight,
                            double slack) {
  if (e.technique == Technique::kCollision) {
    // β and the rate of collisions are the tracking's own; the emission is proportional to the medium's.
    const DVec3 emission = scene_.medium(end.source).emission(e.p);
    const double rate = largest(emission) / largest(e.source_radiance);
    compare("the emission at a collision", e.source_radiance * rate, emission, 2e-4);
    compare("the value of a collision", e.added, e.beta * e.source_radiance * weight, slack, &report_->value_deviation);
    return;
  }
  compare("the throughput", e.beta, so_far_.beta(), so_far_.slack);
  const bool sampled = chosen(e.technique, {1, 0, 0, 0, 0}) != 1;
  DVec3 radiance, nudged_radiance;
  if (end.kind == LightEnd::Kind::kEnvironment) {
    radiance = nudged_radiance = scene_.environment();
  } else if (end.kind == LightEnd::Kind::kEmission) {
    radiance = scene_.medium(end.source).emission(end.p);
    nudged_radiance = scene_.medium(end.source).emission(end.p + kNudge);
  } else {
    DVec3 from = vertex.p, arrives = end.wi;
    if (end.refracted) {
      const Body* glass = scene_.glass_around(vertex.p);
      const auto c = glass != nullptr ? cross(*glass, vertex.p, end.wi) : std::nullopt;
      if (!c) throw TooNear{};
      from = c->v;
      arrives = c->wo;
    }
    radiance = scene_.light(end.source).radiance(from, end.primitive, end.p, arrives, sampled);
    nudged_radiance = scene_.light(end.source).radiance(from + kNudge, end.primitive, end.p, arrives, sampled);
  }
  slack += so_far_.slack + 1e-4 + 4 * largest(nudged_radiance - radiance) / std::max(largest(radiance), 1e-30);
  compare("the radiance of a light", e.source_radiance, radiance, slack);
  if (!sampled) {
    compare("the value of light met", e.added, so_far_.beta() * radiance * weight, slack, &report_->value_deviation);
    return;
  }
  if (end.kind == LightEnd::Kind::kShape && scene_.light(end.source).hides(vertex.p, end.primitive, end.p))
    fail("light is sampled at " + text(end.p) + " through another part of what emits it, from " + text(vertex.p));
  const std::optional<DVec3> f = scattering_value(scene_, vertex, end.wi);
  if (!f) return;  // of a layered model by walks: an estimate of its own
  slack += scattering_tolerance(scene_, vertex, end.wi);
  const bool bounded =
      end.kind == LightEnd::Kind::kEmission || (end.kind == LightEnd::Kind::kShape && scene_.light(end.source).is_bounded());
  const double length = bounded ? glm::distance(end.p, vertex.p) : 1e30;
  const auto found = scene_.way(vertex.p, end.wi, length);
  bool known = found.has_value();
  SceneFormulas::Way way = found.value_or(SceneFormulas::Way{DVec3(1), 0});
  double factor = 1;
  if (end.refracted) {
    const ThroughGlass glass = through_glass(vertex, end);
    known = glass.transmittance.has_value();
    way = {glass.transmittance.value_or(DVec3(1)), glass.depth};
    factor = glass.boundary / glass.survival;
  }
  for (int i = 0; i < 4; ++i) {
    LastVertex v = vertex;
    LightEnd n = end;
    nudge(i, v, n);
    if (end.refracted) {
      const ThroughGlass other = through_glass(v, n);
      slack += 2 * std::abs(other.boundary / other.survival / factor - 1) + (known ? 2 * std::abs(other.depth - way.depth) : 0);
    } else if (known)
      slack += 2 * std::abs(scene_.way(v.p, n.wi, length).value_or(way).depth - way.depth);
    const double change = largest(scattering_value(scene_, v, n.wi).value_or(DVec3(0)) - *f);
    if (change > 0 && largest(*f) == 0) throw TooNear{};  // on the horizon
    if (change > 0) slack += 2 * change / largest(*f);
  }
  DVec3 value = *f * radiance * factor, transmittance = e.transmittance;
  if (e.technique == Technique::kEquiangular) value *= scene_.medium(vertex.medium).sigma_s(vertex.p);
  // The way to the light in closed form, where it has one.
  if (known && e.technique == Technique::kEquiangular) {
    const MediumFormula& medium = scene_.medium(vertex.medium);
    if (medium.is_homogeneous()) {
      const DVec3 depth = medium.sigma_t(vertex.p) * e.t;
      way.transmittance *= glm::exp(-depth);
      way.depth += largest(depth);
    } else {
      known = false;
    }
  }
  if (known && (way.depth == 0 || (settings_.plan && has(Feature::kClosedForms)))) {
    ++report_->exact_values;
    transmittance = way.transmittance;
    slack += 1e-5 * (1 + way.depth);
  }
  // What branches find, too.
  if (e.technique == Technique::kLightSample || e.technique == Technique::kRefractedSample) {
    report_->shared += light_share_ < 1;
    value *= light_share_;
    slack += share_slack_;
  }
  if (e.technique == Technique::kEquiangular) {
    report_->shared += next_light_share_ < 1;
    value *= next_light_share_;
    slack += next_slack_;
  }
  if (e.technique == Technique::kLightSample && vertex.kind == LastVertex::Kind::kMedium && has(Feature::kLightRoulette)) {
    // Traced in any case from 4π β f = ½ on.
    const double survival = std::min(1.0, 8 * std::numbers::pi * directions_ * largest(so_far_.beta() * *f * light_share_));
    report_->light_roulettes += survival < 1;
    value /= survival;
    slack *= 2;
  }
  compare("the value of a light sample", e.added, so_far_.beta() * value * transmittance * (weight / density), slack,
          &report_->value_deviation);
}

}  // namespace woodcock::testing
