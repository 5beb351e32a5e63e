#include "renderer/materials/material.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "renderer/scene/scene_error.h"

namespace woodcock {

namespace {

Rgb clamp01(Rgb c) { return glm::clamp(c, Rgb(0), Rgb(1)); }
float not_negative(float x) { return x > 0 ? x : 0; }  // NaN becomes 0 too

/// Evaluates descriptions at one point.
struct Evaluator {
  const Textures& textures;
  const TextureContext& at;
  const CoatTable* table = nullptr;

  template <typename Parameter>
  auto operator()(const Parameter& p) const {
    return textures.eval(p, at);
  }

  Ggx roughness(const RoughnessDescription& r) const {
    const float u = not_negative((*this)(r.u)), v = not_negative((*this)(r.v));
    return r.remap ? Ggx::from_alpha(std::sqrt(u), std::sqrt(v)) : Ggx::from_alpha(u, v);
  }

  /// `outside` is the index of the medium above the metal.
  ConductorBsdf conductor(const ConductorDescription& c, float outside) const {
    Rgb eta(1), k;
    if (c.reflectance) {
      // At normal incidence and eta = 1, r = k²/(k² + 4). Kept below 1, where k is infinite.
      const Rgb r = glm::clamp((*this)(*c.reflectance), Rgb(0), Rgb(0.9999f));
      k = 2.0f * glm::sqrt(r) / glm::sqrt(1.0f - r);
    } else {
      eta = (*this)(c.eta);
      k = (*this)(c.k);
    }
    return {eta / outside, k / outside, roughness(c.roughness)};
  }

  Coat coat(const CoatDescription& c) const {
    Coat result;
    result.boundary = {c.eta, roughness(c.roughness)};
    // Beyond this it is unbounded, and a float does not tell a step from none.
    result.thickness = std::min(1e4f, not_negative((*this)(c.thickness)));
    result.g = std::clamp((*this)(c.g), -0.9999f, 0.9999f);
    result.albedo = clamp01((*this)(c.albedo));
    result.max_depth = c.max_depth;
    result.samples = std::max(1, c.samples);
    return result;
  }

  std::optional<Bsdf> operator()(const InterfaceDescription&) const { return std::nullopt; }
  std::optional<Bsdf> operator()(const DiffuseDescription& d) const { return DiffuseBsdf{clamp01((*this)(d.reflectance))}; }
  std::optional<Bsdf> operator()(const DiffuseTransmissionDescription& d) const {
    return DiffuseTransmissionBsdf{clamp01(d.scale * (*this)(d.reflectance)), clamp01(d.scale * (*this)(d.transmittance))};
  }
  std::optional<Bsdf> operator()(const ConductorDescription& d) const { return conductor(d, 1); }
  std::optional<Bsdf> operator()(const DielectricDescription& d) const { return DielectricBsdf{d.eta, roughness(d.roughness)}; }
  std::optional<Bsdf> operator()(const ThinDielectricDescription& d) const { return ThinDielectricBsdf{d.eta}; }
  std::optional<Bsdf> operator()(const CoatedDiffuseDescription& d) const {
    return CoatedDiffuseBsdf{coat(d.coat), {clamp01((*this)(d.reflectance))}, table};
  }
  std::optional<Bsdf> operator()(const CoatedConductorDescription& d) const {
    return CoatedConductorBsdf{coat(d.coat), conductor(d.conductor, d.coat.eta)};
  }
  std::optional<Bsdf> operator()(const MixDescription&) const { return std::nullopt; }  // resolved before
};

/// n turned to the side of `reference`; `reference` itself where n is degenerate.
Vec3 oriented(Vec3 n, Vec3 reference) {
  const float length = glm::length(n);
  if (!(length > 0) || !std::isfinite(length)) return reference;
  n /= length;
  return glm::dot(n, reference) < 0 ? -n : n;
}

}  // namespace

Materials::Materials(const SceneDescription& scene, const Textures& textures, double scale)
    : scale_(static_cast<float>(scale)), textures_(&textures) {
  for (const MaterialDescription& m : scene.materials) {
    Entry e{m.kind, m.normal_map, m.displacement};
    e.interface = std::holds_alternative<InterfaceDescription>(m.kind);
    e.perturbs = m.normal_map != kNone || m.displacement != kNone;
    entries_.push_back(std::move(e));
  }
  std::vector<int> state(entries_.size(), 0);
  for (size_t i = 0; i < entries_.size(); ++i) link(scene, static_cast<int>(i), state);
  tabulate_coats();
}

/// Whether one table serves all of the material: nothing of the coat comes from a texture. Whether it has a closed form is
/// seen by its values.
static bool is_constant(const CoatDescription& c) {
  return c.roughness.u.texture == kNone && c.roughness.v.texture == kNone && c.thickness.texture == kNone && c.albedo.texture == kNone;
}

void Materials::tabulate_coats() {
  std::map<std::tuple<float, float, float>, std::shared_ptr<const CoatTable>> tables;
  for (Entry& e : entries_) {
    const auto* coated = std::get_if<CoatedDiffuseDescription>(&e.kind);
    if (coated == nullptr || !is_constant(coated->coat)) continue;
    const Coat coat = Evaluator{*textures_, {}}.coat(coated->coat);
    const Ggx& roughness = coat.boundary.roughness;
    if (coat.scatters() || roughness.alpha_x != roughness.alpha_y) continue;
    // Total reflection at rough facets from outside has a kink that the table's quadrature does not meet.
    if (coat.boundary.eta < 1 && !coat.boundary.delta()) continue;
    std::shared_ptr<const CoatTable>& table = tables[{coat.boundary.eta, roughness.alpha_x, coat.thickness}];
    if (!table) table = std::make_shared<const CoatTable>(coat.boundary.eta, roughness, coat.thickness);
    e.coat = table;
  }
}

/// Fills what a mix inherits from its parts. `state`: 0 not visited, 1 being visited, 2 done.
void Materials::link(const SceneDescription& scene, int material, std::vector<int>& state) {
  const size_t i = static_cast<size_t>(material);
  if (state[i] == 2) return;
  if (state[i] == 1)
    throw SceneError(scene.materials[i].where, "material \"" + scene.materials[i].name + "\" is a mix that contains itself");
  state[i] = 1;
  if (const auto* mix = std::get_if<MixDescription>(&entries_[i].kind)) {
    for (const int part : {mix->material1, mix->material2}) {
      if (part < 0 || static_cast<size_t>(part) >= entries_.size())
        throw SceneError(scene.materials[i].where, "material \"" + scene.materials[i].name + "\" mixes a material that does not exist");
      link(scene, part, state);
    }
    const Entry &a = at(mix->material1), &b = at(mix->material2);
    entries_[i].interface = a.interface && b.interface;
    entries_[i].perturbs = a.perturbs || b.perturbs;
  }
  state[i] = 2;
}

int Materials::resolve(int material, const TextureContext& where, Stream& choice) const {
  while (const auto* mix = std::get_if<MixDescription>(&at(material).kind)) {
    const float amount = textures_->eval(mix->amount, where);
    material = choice.uniform() < amount ? mix->material2 : mix->material1;
  }
  return material;
}

std::optional<Bsdf> Materials::bsdf(int material, const TextureContext& where, Stream& choice) const {
  const Entry& entry = at(resolve(material, where, choice));
  return std::visit([&](const auto& d) -> std::optional<Bsdf> { return Evaluator{*textures_, where, entry.coat.get()}(d); }, entry.kind);
}

DiffuseBsdf Materials::diffuse(int material, const TextureContext& where) const {
  return {clamp01(textures_->eval(std::get<DiffuseDescription>(at(material).kind).reflectance, where))};
}

Vec3 Materials::shading_normal(int material, const TextureContext& where, const ShadingGeometry& geometry) const {
  const Entry& entry = at(material);
  const Vec3 n = geometry.n;
  if (entry.normal_map != kNone) {
    const Vec3 local = 2.0f * textures_->eval(RgbParameter{Rgb(0), entry.normal_map}, where) - 1.0f;
    // The frame keeps n and the direction of dp/du as nearly as it can.
    Vec3 s = geometry.dpdu - n * glm::dot(n, geometry.dpdu);
    const float length = glm::length(s);
    if (!(length > 0) || !std::isfinite(length)) return n;
    s /= length;
    return oriented(s * local.x + glm::cross(n, s) * local.y + n * local.z, n);
  }
  if (entry.displacement != kNone) {
    const FloatParameter height{0, entry.displacement};
    constexpr float kStep = 0.0005f;  // in u and v
    const float h = scale_ * textures_->eval(height, where);
    const float hu = scale_ * textures_->eval(height, {where.uv + Vec2(kStep, 0), where.p + kStep * geometry.dpdu});
    const float hv = scale_ * textures_->eval(height, {where.uv + Vec2(0, kStep), where.p + kStep * geometry.dpdv});
    const Vec3 dpdu = geometry.dpdu + ((hu - h) / kStep) * n + h * geometry.dndu;
    const Vec3 dpdv = geometry.dpdv + ((hv - h) / kStep) * n + h * geometry.dndv;
    return oriented(glm::cross(dpdu, dpdv), n);
  }
  return n;
}

}  // namespace woodcock
