#include "renderer/transport/walk.h"

#include <cmath>

#include "renderer/core/warp.h"
#include "renderer/transport/roulette.h"

namespace woodcock {
namespace {

/// Russian roulette from the second scattering on, relative to the branch's own start.
bool survives_roulette(WalkSample& sample, Walk& w) {
  if (sample.stopped || is_black(w.beta)) return false;
  if (w.depth < 2) return true;
  const float q = roulette_survival(w.beta, w.eta_scale, w.start_weight);
  if (q >= 1) return true;
  if (!(q > 0) || stream(w.key, w.vertex, Purpose::kRoulette).uniform_double() >= static_cast<double>(q)) return false;
  w.beta /= q;
  return true;
}

/// What scattering changes beside the throughput.
bool go_on(WalkSample& sample, Walk& w, const Ray& ray) {
  w.ray = ray;
  w.unseen = 0;
  w.new_ray();
  return survives_roulette(sample, w);
}

/// Delta lobes beside others in one model: uniform directions alone would miss the delta lobes.
bool has_delta_beside_others(const Bsdf& bsdf) {
  if (const auto* coated = std::get_if<CoatedDiffuseBsdf>(&bsdf)) return coated->coat.boundary.delta();
  if (const auto* coated = std::get_if<CoatedConductorBsdf>(&bsdf)) return coated->coat.boundary.delta() && !is_specular(bsdf);
  return false;
}

bool transmits(const Bsdf& bsdf) {
  return std::holds_alternative<DiffuseTransmissionBsdf>(bsdf) || std::holds_alternative<DielectricBsdf>(bsdf);
}

/// A direction uniform on the hemisphere of wo, or on the sphere: weight f |cos|/pdf. Local.
BsdfSample sample_uniformly(const Bsdf& bsdf, Vec3 wo, Vec2 u, Stream& layered) {
  BsdfSample s;
  if (transmits(bsdf)) {
    s.wi = square_to_sphere(u);
    s.pdf = square_to_sphere_pdf();
    s.transmission = !same_hemisphere(s.wi, wo);
  } else {
    s.wi = square_to_hemisphere(u);
    if (wo.z < 0) s.wi = -s.wi;
    s.pdf = square_to_hemisphere_pdf();
  }
  s.weight = eval(bsdf, wo, s.wi, layered) / s.pdf;
  return s;
}

/// Makes the walk's ray the one from the surface, the member of the place where it stands or kNone, that heads for `to`.
void set_off(Walk& w, const SurfacePoint& s, int member, DVec3 to) {
  if (member != kNone) w.here->leave(member, to);
  w.ray = w.here ? w.here->ray_from(s.p, to, w.ray.time) : ray_from(s, to, w.ray.time);
}

}  // namespace

void WalkSample::see(const Walk& w, float share, Rgb albedo, Vec3 normal, double distance) {
  if (!(share > 0)) return;
  result.albedo += share * albedo;
  result.normal += share * normal;
  result.depth += share * static_cast<float>((w.travelled + distance) / world.space.scale);
}

void WalkSample::next_vertex(Walk& w) {
  ++w.vertex;
  ++w.depth;
  if ((++count.vertices & (kReportEvery - 1)) != 0 || plan.watch == nullptr) return;
  plan.watch->vertices.fetch_add(kReportEvery, std::memory_order_relaxed);
  stopped = stopped || plan.watch->cancel.load(std::memory_order_relaxed);
}

Walk WalkSample::branch(const Walk& w, Rgb weight) {
  Walk copy = w;
  copy.key = branch_key(w.key, ++branches);
  copy.beta *= weight;
  copy.start_weight = max_component(glm::abs(copy.beta)) * copy.eta_scale;
  copy.unseen = 0;
  copy.first = false;
  return copy;
}

bool scatter_uniformly(WalkSample& sample, Walk& w, const Medium& medium, DVec3 p) {
  sample.next_vertex(w);
  const Vec3 wi = square_to_sphere(stream(w.key, w.vertex, Purpose::kDirection).uniform2());
  w.beta *= medium.phase_at(p).eval(Vec3(-w.ray.d), wi) / square_to_sphere_pdf();
  w.first = false;
  return go_on(sample, w, {p, wi, w.ray.time});
}

bool scatter_by_phase(WalkSample& sample, Walk& w, const Medium& medium, DVec3 p) {
  sample.next_vertex(w);
  Stream random = stream(w.key, w.vertex, Purpose::kDirection);
  const Vec2 u = random.uniform2();
  const auto s = medium.phase_at(p).sample(Vec3(-w.ray.d), u, random.uniform());
  w.beta *= s.weight;
  w.first = false;
  return go_on(sample, w, {p, s.wi, w.ray.time});
}

bool diverges(const EndlessPart& endless, const Walk& w, bool scatters) {
  const MediumPoint& m = endless.point;
  for (int c = 0; c < 3; ++c)
    if (w.beta[c] > 0 && m.sigma_t[c] == 0 && (m.emission[c] > 0 || (scatters && m.sigma_s[c] > 0))) return true;
  return false;
}

SurfacePoint arrive(WalkSample& sample, Walk& w, const Hit& hit) {
  const World& world = sample.world;
  const SurfacePoint s = world.geometry.surface(hit, w.ray);
  w.travelled += hit.t;
  if (!may_coincide(world, w.ray, hit, s.p)) return s;
  w.here.emplace(world, w.ray, hit);
  w.ray = w.here->ray_from(s.p, w.ray.d, w.ray.time);
  if (w.here->overflowed()) {
    ++sample.count.truncated;
    sample.stopped = true;
  }
  return s;
}

int next_member(WalkSample& sample, Walk& w) {
  if (!w.here) return kNone;
  const int member = w.here->next(w.ray.d, w.medium);
  if (member != kNone) return member;
  w.medium = w.here->medium_behind(sample.world, w.ray, w.medium);
  w.here.reset();
  return kNone;
}

SurfaceMeeting meet(WalkSample& sample, Walk& w, const Hit& hit, const SurfacePoint& s, int member) {
  const World& world = sample.world;
  SurfaceMeeting meeting{s, member, kNone, &world.surfaces[static_cast<size_t>(hit.shape)], std::nullopt, Vec3(0)};
  const SurfaceInfo& info = *meeting.info;
  const TextureContext context{s.uv, s.p};
  if (info.has_alpha && w.crossing.uniform() >= world.textures.eval(info.alpha, context)) {
    set_off(w, s, member, w.ray.d);
    return meeting;
  }
  if (info.light != kNone) sample.add(w, world.lights.emitted(info.light, {s.p, s.ng, s.uv, hit.primitive, hit.uv}, Vec3(-w.ray.d)));
  int material = info.material;
  if (!info.is_interface) {
    material = world.materials.resolve(material, context, w.crossing);
    meeting.bsdf = world.materials.bsdf(material, context, w.crossing);
  }
  if (meeting.bsdf && member != kNone)
    meeting.joined = join_dielectrics(world, *w.here, member, w.ray.d, w.medium, w.crossing, *meeting.bsdf);
  if (!meeting.bsdf) {
    w.medium = world.medium_after(info, s.ng, w.ray.d, w.medium);
    set_off(w, s, member, w.ray.d);
    return meeting;
  }
  meeting.normal = world.materials.shading_normal(material, context, {s.ns, s.dpdu, s.dpdv});
  const Frame frame = shading_frame(meeting.normal, s.dpdu);
  sample.see(w, w.unseen, albedo(*meeting.bsdf, frame.to_local(Vec3(-w.ray.d))), meeting.normal, 0);
  w.unseen = 0;
  return meeting;
}

bool bounce(WalkSample& sample, Walk& w, const SurfaceMeeting& meeting) {
  const Bsdf& bsdf = *meeting.bsdf;
  const SurfacePoint& s = meeting.point;
  const Frame frame = shading_frame(meeting.normal, s.dpdu);
  const Vec3 wo = frame.to_local(Vec3(-w.ray.d));
  sample.next_vertex(w);
  Stream direction = stream(w.key, w.vertex, Purpose::kDirection), layered = stream(w.key, w.vertex, Purpose::kLayered);
  std::optional<BsdfSample> scattered;
  const bool mixed = has_delta_beside_others(bsdf);
  // Of the two parts of such a model one is chosen by a coin, and counts twice.
  const bool delta = is_specular(bsdf) || (mixed && stream(w.key, w.vertex, Purpose::kBranching).uniform() < 0.5f);
  if (delta) {
    scattered = woodcock::sample(bsdf, wo, direction, layered);
    if (!scattered || !scattered->specular) return false;
  } else {
    scattered = sample_uniformly(bsdf, wo, direction.uniform2(), layered);
  }
  w.beta *= scattered->weight * (mixed ? 2.0f : 1.0f);
  if (scattered->transmission) w.eta_scale *= scattered->eta * scattered->eta;
  w.first = w.first && is_specular(bsdf);
  const Vec3 wi = glm::normalize(frame.to_world(scattered->wi));
  w.medium = sample.world.medium_after(*meeting.info, s.ng, wi, w.medium);
  if (meeting.joined != kNone && scattered->transmission) {
    const Junction::Member& entry = (*w.here)[meeting.joined];
    w.medium = sample.world.medium_after(sample.world.surfaces[static_cast<size_t>(entry.hit.shape)], entry.s.ng, wi, w.medium);
    w.here->leave(meeting.joined, wi);
  }
  set_off(w, s, meeting.member, wi);
  return go_on(sample, w, w.ray);
}

void meet_environment(WalkSample& sample, const Walk& w) {
  if (sample.world.lights.has_environment()) sample.add(w, sample.world.lights.environment(w.ray.d));
}

}  // namespace woodcock
