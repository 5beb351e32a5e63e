// Makes a failing case small.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "renderer/selftest/campaign.h"

namespace woodcock::selftest {
namespace {

using Cases = std::vector<Case>;

/// One significant decimal digit.
double coarse(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0e", value);
  return std::strtod(text, nullptr);
}
DVec3 coarse(DVec3 v) { return {coarse(v.x), coarse(v.y), coarse(v.z)}; }

bool is_grey(DVec3 v) { return v.x == v.y && v.y == v.z; }

/// Media that are simpler than this one; empty where none is.
std::vector<MediumPart> simpler(const MediumPart& medium) {
  std::vector<MediumPart> list = medium.parts;
  const auto with = [&](auto&& change) {
    MediumPart m = medium;
    change(m);
    list.push_back(m);
  };
  if (medium.form == MediumForm::kSum) {
    for (size_t i = 0; i < medium.parts.size(); ++i) {
      if (medium.parts.size() > 2) with([&](MediumPart& m) { m.parts.erase(m.parts.begin() + static_cast<std::ptrdiff_t>(i)); });
      for (const MediumPart& part : simpler(medium.parts[i])) {
        if (part.form != MediumForm::kSum) with([&](MediumPart& m) { m.parts[i] = part; });
      }
    }
    return list;
  }
  if (medium.form != MediumForm::kHomogeneous) with([](MediumPart& m) { m.form = MediumForm::kHomogeneous; });
  if (medium.phase.kind != "isotropic") with([](MediumPart& m) { m.phase = {}; });
  if (!is_grey(medium.depth)) with([](MediumPart& m) { m.depth = DVec3(std::max({m.depth.x, m.depth.y, m.depth.z})); });
  if (!is_grey(medium.albedo)) with([](MediumPart& m) { m.albedo = DVec3(m.albedo.x); });
  // A cloud emits nothing, so in a furnace it does not absorb either.
  if (medium.form != MediumForm::kCloud && is_grey(medium.albedo) && medium.albedo.x != 0 && medium.albedo.x != 0.5) {
    with([](MediumPart& m) { m.albedo = DVec3(0); });
    with([](MediumPart& m) { m.albedo = DVec3(0.5); });
  }
  if (is_grey(medium.depth) && medium.depth.x != 1) {
    with([](MediumPart& m) { m.depth = DVec3(1); });
    with([](MediumPart& m) { m.depth = coarse(m.depth); });
  }
  if (medium.form == MediumForm::kUniformGrid && medium.density.size() > 1 && !medium.emission_grid)
    with([](MediumPart& m) { m.size = IVec3(1), m.density = {1}; });
  return list;
}

void simpler_body(const Case& c, size_t i, Cases& list) {
  const Body& body = c.scene.bodies[i];
  const auto with = [&](auto&& change) {
    Case other = c;
    change(other.scene.bodies[i]);
    list.push_back(other);
  };
  if (body.enclosure) {
    Case open = c;
    remove_body(open.scene, static_cast<int>(i));
    open.scene.medium.reset();
    open.scene.lights.push_back({});
    list.push_back(open);
    if (body.form != Form::kSphere) with([](Body& b) { b.form = Form::kSphere; });
    if (!body.two_sided) with([](Body& b) { b.two_sided = true, b.reversed = false; });
  } else {
    Case without = c;
    remove_body(without.scene, static_cast<int>(i));
    list.push_back(without);
    if (is_closed(body.form) && body.form != Form::kSphere && !is_half_box(body.form)) with([](Body& b) { b.form = Form::kSphere; });
    if (!body.two_sided) with([](Body& b) { b.two_sided = true; });
    if (body.reversed) with([](Body& b) { b.reversed = false; });
  }
  if (body.medium) {
    with([](Body& b) { b.medium.reset(); });
    for (const MediumPart& medium : simpler(*body.medium)) with([&](Body& b) { b.medium = medium; });
  }
  if (body.instance) with([](Body& b) { b.instance = false; });
  if (body.alpha < 1) with([](Body& b) { b.alpha = 1; });
  if (body.stretch != DVec3(1)) with([](Body& b) { b.stretch = DVec3(1); });
  if (body.angle != 0) with([](Body& b) { b.angle = 0, b.axis = {0, 0, 1}; });
  if (body.form != Form::kSheet && !is_closed(body.form)) with([](Body& b) { b.form = Form::kSheet; });
  if (body.center != coarse(body.center)) with([](Body& b) { b.center = coarse(b.center); });
  if (body.radius != coarse(body.radius)) with([](Body& b) { b.radius = coarse(b.radius); });
  const MaterialPart& material = body.material;
  if (material.form == MaterialForm::kMix) {
    for (const MaterialPart& part : material.mixed)
      if (part.form != MaterialForm::kInterface || body.has_boundary) with([&](Body& b) { b.material = part; });
  }
  if (is_region(body) && material.form != MaterialForm::kInterface && body.medium)
    with([](Body& b) { b.material.form = MaterialForm::kInterface; });
  if (material.form == MaterialForm::kDiffuse && material.reflectance != DVec3(0.5)) {
    with([](Body& b) { b.material.reflectance = DVec3(0.5); });
    if (material.reflectance != DVec3(0)) with([](Body& b) { b.material.reflectance = DVec3(0); });
  }
  if (material.form == MaterialForm::kDiffuseTransmission) with([](Body& b) { b.material.form = MaterialForm::kDiffuse; });
}

Cases simpler(const Case& c) {
  Cases list;
  const auto with = [&](auto&& change) {
    Case other = c;
    change(other);
    list.push_back(other);
  };
  for (size_t i = c.scene.bodies.size(); i-- > 0;) simpler_body(c, i, list);
  if (c.scene.medium) {
    with([](Case& o) { o.scene.medium.reset(); });
    for (const MediumPart& medium : simpler(*c.scene.medium)) with([&](Case& o) { o.scene.medium = medium; });
  }
  if (c.scene.furnace && c.scene.lights.size() > 1) with([](Case& o) { o.scene.lights.assign(1, {}); });
  if (!c.scene.furnace && c.scene.lights.size() > 1)
    for (size_t i = 0; i < c.scene.lights.size(); ++i)
      with([&](Case& o) { o.scene.lights.erase(o.scene.lights.begin() + static_cast<std::ptrdiff_t>(i)); });
  if (c.scene.placement.offset != DVec3(0)) with([](Case& o) { o.scene.placement.offset = DVec3(0); });
  if (c.scene.placement.scale != 1) with([](Case& o) { o.scene.placement.scale = 1; });
  const CameraPart& camera = c.scene.camera;
  if (camera.lens_radius > 0) with([](Case& o) { o.scene.camera.lens_radius = 0; });
  if (camera.orthographic) with([](Case& o) { o.scene.camera.orthographic = false, o.scene.camera.fov = 5; });
  if (camera.eye != coarse(camera.eye)) with([](Case& o) { o.scene.camera.eye = coarse(o.scene.camera.eye); });
  if (camera.target != coarse(camera.target)) with([](Case& o) { o.scene.camera.target = coarse(o.scene.camera.target); });
  if (camera.fov != coarse(camera.fov)) with([](Case& o) { o.scene.camera.fov = coarse(o.scene.camera.fov); });
  if (c.relation == Relation::kFurnace && !c.rendering.options().empty()) with([](Case& o) { o.rendering = {}; });
  return list;
}

/// Whether a changed scene still is one of which the promise holds.
bool is_sound(const Case& c) {
  const Scene& scene = c.scene;
  const bool enclosed = !scene.bodies.empty() && scene.bodies[0].enclosure;
  if (scene.lights.empty() && !enclosed && scene.furnace) return false;
  if (scene.medium && !enclosed && std::max({scene.medium->albedo.x, scene.medium->albedo.y, scene.medium->albedo.z}) >= 1) return false;
  if (scene.medium && !enclosed && std::min({scene.medium->depth.x, scene.medium->depth.y, scene.medium->depth.z}) <= 0) return false;
  if (scene.camera.eye == scene.camera.target) return false;
  for (size_t i = 0; i < scene.bodies.size(); ++i) {
    const Body& body = scene.bodies[i];
    // Light that is reflected totally inside of glass must meet a medium.
    const bool traps = changes_index(body.material) || body.material.form == MaterialForm::kThinGlass;
    bool holds = scene.camera.region == static_cast<int>(i);
    for (const Body& other : scene.bodies) {
      holds |= other.parent == static_cast<int>(i);
      // Nothing may come to overlap glass, and boxes that touch keep touching.
      if (&other == &body || other.enclosure || body.enclosure || other.parent != body.parent) continue;
      const bool were_together = is_half_box(body.form) && is_half_box(other.form) && glm::length(other.center - body.center) < body.radius;
      if (were_together && (other.center != body.center || other.radius != body.radius || other.axis != body.axis ||
                            other.angle != body.angle || other.stretch != body.stretch))
        return false;
      const bool apart = glm::length(other.center - body.center) > other.radius + body.radius;
      if (!apart && !(is_half_box(body.form) && is_half_box(other.form)) && (changes_index(body.material) || changes_index(other.material)))
        return false;
    }
    if (traps && holds && !body.medium) return false;
    if (body.parent != kRoot) {
      const Body& parent = scene.bodies[static_cast<size_t>(body.parent)];
      const double room = parent.radius * inscribed_radius(parent.form) *
                          std::min({std::abs(parent.stretch.x), std::abs(parent.stretch.y), std::abs(parent.stretch.z)});
      if (glm::length(body.center - parent.center) + body.radius > room) return false;
    }
    if (!body.enclosure && scene.camera.region == body.parent && is_closed(body.form) &&
        glm::length(scene.camera.eye - body.center) < body.radius * 1.001)
      return false;
    if (scene.camera.region == static_cast<int>(i) &&
        glm::length(scene.camera.eye - body.center) >
            0.999 * body.radius * inscribed_radius(body.form) *
                std::min({std::abs(body.stretch.x), std::abs(body.stretch.y), std::abs(body.stretch.z)}))
      return false;
  }
  return true;
}

}  // namespace

Case shrink(const Case& c, uint64_t seed, const Effort& effort, const std::function<bool()>& go_on) {
  Case smallest = c;
  for (bool smaller = true; smaller;) {
    smaller = false;
    for (const Case& candidate : simpler(smallest)) {
      if (!go_on()) return smallest;
      if (!is_sound(candidate)) continue;
      const Finding finding = examine(candidate, seed, effort);
      const bool fails = !finding.fault.empty() || (!finding.comparisons.empty() && worst(finding.comparisons).p < 1e-7);
      if (!fails) continue;
      smallest = candidate;
      smaller = true;
      break;
    }
  }
  return smallest;
}

}  // namespace woodcock::selftest
