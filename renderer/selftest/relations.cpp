#include "renderer/selftest/relations.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "renderer/selftest/random_parts.h"
#include "renderer/selftest/random_rendering.h"
#include "renderer/selftest/random_scene.h"

namespace woodcock::selftest {
namespace {

constexpr std::array<std::array<int, 3>, 5> kPermutations{{{1, 2, 0}, {2, 0, 1}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}}};
/// Farther from the origin than this stands nothing but an enclosure.
constexpr double kOutside = 3;
constexpr double kLargeLamp = 1e-2, kSmallLamp = 1e-5;

DVec3 permuted(DVec3 v, const std::array<int, 3>& p) { return {v[p[0]], v[p[1]], v[p[2]]}; }

void permute(MediumPart& medium, const std::array<int, 3>& p) {
  for (DVec3* v : {&medium.depth, &medium.albedo, &medium.emission}) *v = permuted(*v, p);
  for (MediumPart& part : medium.parts) permute(part, p);
}

void permute(MaterialPart& material, const std::array<int, 3>& p) {
  for (DVec3* v : {&material.reflectance, &material.transmittance, &material.sigma_a, &material.sigma_s}) *v = permuted(*v, p);
  for (MaterialPart& part : material.mixed) permute(part, p);
}

void permute(Scene& scene, const std::array<int, 3>& p) {
  if (scene.medium) permute(*scene.medium, p);
  for (LightPart& light : scene.lights) light.colour = permuted(light.colour, p);
  for (Body& body : scene.bodies) {
    if (body.medium) permute(*body.medium, p);
    permute(body.material, p);
    body.emission = permuted(body.emission, p);
  }
}

/// Adds a sphere that has the same medium on both sides; false where no region with a medium has room.
bool add_boundary(const Change& change, Scene& scene) {
  std::vector<int> regions;
  if (scene.medium) regions.push_back(kRoot);
  for (size_t i = 0; i < scene.bodies.size(); ++i)
    if (scene.bodies[i].medium && is_region(scene.bodies[i]) && inscribed_radius(scene.bodies[i].form) > 0)
      regions.push_back(static_cast<int>(i));
  if (regions.empty()) return false;
  const int region = regions[static_cast<size_t>(change.choice) % regions.size()];
  const Body* around = region == kRoot ? nullptr : &scene.bodies[static_cast<size_t>(region)];
  const double room = around == nullptr
                          ? 1.5
                          : around->radius * inscribed_radius(around->form) *
                                std::min({std::abs(around->stretch.x), std::abs(around->stretch.y), std::abs(around->stretch.z)});
  const DVec3 middle = around == nullptr ? DVec3(0) : around->center;
  for (double size = 0.9; size > 0.01; size *= 0.7) {
    Body b;
    b.parent = region;
    b.material.form = MaterialForm::kInterface;
    b.has_boundary = b.within = true;
    b.radius = RandomDraws::rounded(room * size);
    const DVec3 at = middle + change.direction * (room * 0.9 * (1 - size));
    b.center = {RandomDraws::rounded(at.x), RandomDraws::rounded(at.y), RandomDraws::rounded(at.z)};
    if (glm::length(b.center - middle) + b.radius > 0.99 * room) continue;
    bool free = std::abs(glm::length(scene.camera.eye - b.center) - b.radius) > 1e-3 * b.radius;
    for (const Body& other : scene.bodies) {
      if (other.parent != region || other.enclosure || !other.has_boundary) continue;
      free = free && glm::length(other.center - b.center) > 1.01 * (other.radius + b.radius);
    }
    if (!free) continue;
    if (scene.camera.region == region && glm::length(scene.camera.eye - b.center) < b.radius)
      scene.camera.region = static_cast<int>(scene.bodies.size());
    scene.bodies.push_back(b);
    return true;
  }
  return false;
}

bool has_homogeneous(const Scene& scene) {
  if (scene.medium && scene.medium->form == MediumForm::kHomogeneous) return true;
  return std::any_of(scene.bodies.begin(), scene.bodies.end(),
                     [](const Body& b) { return b.medium && b.medium->form == MediumForm::kHomogeneous; });
}

}  // namespace

const char* name_of(Relation relation) {
  constexpr std::array<const char*, kRelationCount> kNames{
      "furnace",   "rendered otherwise", "full kernel", "split in parts", "scaled by two", "scaled",        "moved",
      "mirrored",  "permuted",           "reordered",   "boundary",       "constant grid", "sum of halves", "lights halved",
      "two-sided", "shrunk light",       "far camera",  "far body",       "visibility"};
  return kNames[static_cast<size_t>(relation)];
}

Change random_change(RandomDraws& draw, Relation relation, const Scene& scene) {
  Change change;
  change.direction = draw.direction();
  change.size = draw.log_uniform(1e-4, 1e4);
  change.choice = draw.index(60);
  if (relation == Relation::kRenderedOtherwise) {
    for (int i = 0; i < 40 && change.rendering.options().empty(); ++i) change.rendering = random_rendering(draw, scene);
  }
  return change;
}

std::optional<Variant> changed(Relation relation, const Change& change, const Variant& from) {
  Variant to = from;
  Scene& scene = to.scene;
  Placement& placement = scene.placement;
  switch (relation) {
    case Relation::kRenderedOtherwise:
      if (change.rendering.options().empty()) return std::nullopt;
      to.rendering = change.rendering;
      return to;
    case Relation::kFullKernel:
      to.rendering.full_kernel = true;
      return to;
    case Relation::kScaledByTwo:
      placement.scale *= 2;
      placement.offset *= 2;
      return to;
    case Relation::kScaled:
      placement.scale = RandomDraws::rounded(placement.scale * change.size);
      placement.offset *= placement.scale / from.scene.placement.scale;
      return to;
    case Relation::kMoved:
      placement.offset += (placement.scale * change.size) * change.direction;
      return to;
    case Relation::kMirrored:
      placement.mirrored = !placement.mirrored;
      return to;
    case Relation::kPermuted:
      permute(scene, kPermutations[static_cast<size_t>(change.choice) % kPermutations.size()]);
      return to;
    case Relation::kReordered:
      to.writing.backwards = true;
      return to;
    case Relation::kBoundary:
      if (!add_boundary(change, scene)) return std::nullopt;
      return to;
    case Relation::kConstantGrid:
    case Relation::kSumOfHalves: {
      // A grid has an end, and what lies around everything has none.
      if (!has_homogeneous(scene) || (relation == Relation::kConstantGrid && scene.medium)) return std::nullopt;
      (relation == Relation::kConstantGrid ? to.writing.homogeneous_as_grid : to.writing.homogeneous_as_sum) = true;
      return to;
    }
    case Relation::kLightsHalved:
      to.writing.split_lights = true;
      if (scene_text(from.scene, from.writing) == scene_text(scene, to.writing)) return std::nullopt;
      return to;
    case Relation::kTwoSided: {
      bool any = false;
      for (Body& b : scene.bodies) {
        if (b.two_sided || b.enclosure || !is_closed(b.form) || emission_of(scene, b) == DVec3(0)) continue;
        b.two_sided = any = true;
      }
      if (!any) return std::nullopt;
      return to;
    }
    case Relation::kShrunkLight: {
      if (scene.bodies.empty()) return std::nullopt;
      Body& lamp = scene.bodies.back();
      lamp.radius *= kSmallLamp / kLargeLamp;
      lamp.emission *= (kLargeLamp / kSmallLamp) * (kLargeLamp / kSmallLamp);
      return to;
    }
    case Relation::kFarCamera: {
      // Outside of everything, so that nothing comes to stand before it.
      if (!scene.camera.orthographic || glm::length(scene.camera.eye) < kOutside - 0.01) return std::nullopt;
      scene.camera.eye *= std::max(change.size, 1 / change.size);
      return to;
    }
    case Relation::kFarBody: {
      if (scene.medium || (!scene.bodies.empty() && scene.bodies[0].enclosure)) return std::nullopt;
      Body nothing;
      nothing.material.form = MaterialForm::kInterface;
      nothing.center = change.direction * (5 * std::max(change.size, 1 / change.size));
      nothing.radius = 0.1;
      scene.bodies.push_back(nothing);
      return to;
    }
    default:
      return std::nullopt;
  }
}

int channel_after(Relation relation, const Change& change, int c) {
  if (relation != Relation::kPermuted) return c;
  const auto& p = kPermutations[static_cast<size_t>(change.choice) % kPermutations.size()];
  return static_cast<int>(std::find(p.begin(), p.end(), c) - p.begin());
}

bool is_exact(Relation relation) { return relation == Relation::kFullKernel || relation == Relation::kScaledByTwo; }

bool follows_same_paths(Relation relation) {
  return relation == Relation::kScaled || relation == Relation::kMoved || relation == Relation::kMirrored ||
         relation == Relation::kFarCamera || relation == Relation::kFarBody;
}

double tolerance(Relation relation) {
  // A lamp of a hundredth of its distance: the distances to its parts differ by that, and what arrives by twice as much.
  return relation == Relation::kShrunkLight ? 0.03 : 2e-4;
}

/// A lamp and what it lights, for kShrunkLight: the lamp is the last body.
static Scene random_lamp_scene(RandomDraws& draw) {
  Scene scene;
  scene.furnace = false;
  scene.max_depth = 3;
  Body target;
  target.radius = 0.2;
  if (draw.chance(0.5)) {
    // A ball, and its lit side: what is lit along a sheet sees more of a large lamp than of a small one.
    target.material = random_opaque(draw, 0.9);
    if (target.material.form == MaterialForm::kDiffuse) target.material.reflectance = glm::max(target.material.reflectance, DVec3(0.2));
  } else {
    target.material.form = MaterialForm::kInterface;
    target.has_boundary = true;
    MediumPart fog;
    fog.depth = draw.chance(0.3) ? draw.colour(0.1, 3) : DVec3(draw.uniform(0.1, 3));
    fog.albedo = DVec3(draw.uniform(0.3, 1));
    fog.phase = random_phase(draw);
    target.medium = fog;
  }
  scene.bodies.push_back(target);
  scene.camera.eye = draw.direction();
  Body lamp;
  const double far = draw.chance(0.5) ? 1.0 : draw.log_uniform(1, 100);
  // Where the camera does not look, and on its side.
  do lamp.center = far * draw.direction();
  while (glm::dot(lamp.center, scene.camera.eye) < 0.2 * far ||
         glm::dot(glm::normalize(lamp.center - scene.camera.eye), -scene.camera.eye) > 0.8 * glm::length(scene.camera.eye));
  lamp.form = draw.chance(0.3) ? random_closed_form(draw) : random_open_form(draw);
  lamp.radius = RandomDraws::rounded(kLargeLamp * far * draw.uniform(0.7, 1));
  lamp.material.reflectance = DVec3(0);
  lamp.detail = {draw.uniform(0, 1), draw.uniform(0, 1), draw.uniform(0, 1)};
  lamp.axis = draw.direction();
  lamp.angle = draw.uniform(0, 360);
  if (draw.chance(0.3)) lamp.stretch = draw.colour(0.3, 1);
  if (draw.chance(0.15)) lamp.stretch.x *= -1;
  lamp.two_sided = draw.chance(0.5);
  lamp.reversed = draw.chance(0.4);
  lamp.emission = draw.colour(0.5, 1) * (far * far * 1e5);
  scene.bodies.push_back(lamp);
  scene.camera.target = DVec3(0);
  scene.camera.fov = draw.uniform(10, 25);
  if (draw.chance(0.3)) scene.placement.scale = draw.log_uniform(1e-5, 1e5);
  if (draw.chance(0.3)) scene.placement.offset = (scene.placement.scale * draw.log_uniform(1, 1e4)) * draw.direction();
  return scene;
}

Scene random_scene_for(Relation relation, RandomDraws& draw) {
  if (relation == Relation::kShrunkLight) return random_lamp_scene(draw);
  Scene scene = random_open_scene(draw);
  if (relation == Relation::kTwoSided) {
    for (Body& b : scene.bodies)
      if (!b.two_sided && !b.enclosure && !b.instance && b.material.form == MaterialForm::kDiffuse) {
        b.emission = draw.colour(0.2, 3);
        b.reversed = false;
      }
  }
  if (relation == Relation::kVisibility) {
    if (draw.chance(0.3)) scene = random_lamp_scene(draw);
    scene.medium.reset();
    const bool dark = std::none_of(scene.bodies.begin(), scene.bodies.end(), [](const Body& b) { return b.emission != DVec3(0); });
    for (Body& b : scene.bodies) {
      b.medium.reset();
      b.alpha = 1;
      if (b.material.form == MaterialForm::kMix) b.material = {};
      if (dark && !b.instance && b.material.form == MaterialForm::kDiffuse) b.emission = DVec3(1);
    }
  }
  if (relation == Relation::kFarCamera) {
    CameraPart camera;
    camera.eye = kOutside * draw.direction();
    camera.orthographic = true;
    camera.fov = draw.uniform(0.3, 0.8);
    const bool open = !scene.medium && (scene.bodies.empty() || !scene.bodies[0].enclosure);
    if (open) scene.camera = camera;
    scene.camera.orthographic = open;
  }
  return scene;
}

}  // namespace woodcock::selftest
