#include "renderer/world/world.h"

#include "renderer/world/glass_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "renderer/core/transform.h"
#include "renderer/scene/scene_error.h"
#include "renderer/world/compile_shapes.h"
#include "renderer/world/effect_plan.h"
#include "renderer/world/glass_shapes.h"
#include "renderer/world/medium_boundaries.h"
#include "renderer/world/overlaps.h"
#include "renderer/world/scene_notes.h"
#include "renderer/world/thin_media.h"

namespace woodcock {
namespace {

struct DBox {
  DVec3 lower{std::numeric_limits<double>::infinity()}, upper{-std::numeric_limits<double>::infinity()};
  void add(DVec3 p) {
    lower = glm::min(lower, p);
    upper = glm::max(upper, p);
  }
  bool empty() const { return !(lower.x <= upper.x); }
};

/// Bounds of a shape in the space that `m` leads to, from the corners of its object-space box.
void add_bounds(const ShapeDescription& shape, const DMat4& m, DBox& box) {
  DBox object;
  const auto add_points = [&](const auto& mesh) {
    for (const DVec3 p : mesh->positions) object.add(p);
  };
  if (const auto* mesh = std::get_if<std::shared_ptr<const TriangleMesh>>(&shape.kind)) {
    add_points(*mesh);
  } else if (const auto* patches = std::get_if<std::shared_ptr<const BilinearMesh>>(&shape.kind)) {
    add_points(*patches);
  } else {
    double r = 0, z0 = 0, z1 = 0;
    if (const auto* s = std::get_if<SphereDescription>(&shape.kind)) r = s->radius, z0 = s->z_min, z1 = s->z_max;
    if (const auto* d = std::get_if<DiskDescription>(&shape.kind)) r = d->radius, z0 = z1 = d->height;
    if (const auto* c = std::get_if<CylinderDescription>(&shape.kind)) r = c->radius, z0 = c->z_min, z1 = c->z_max;
    object.add({-r, -r, z0});
    object.add({r, r, z1});
  }
  if (object.empty()) return;
  const DMat4 to = m * shape.world_from_object;
  for (int i = 0; i < 8; ++i) {
    box.add(transform_point(to, {(i & 1) != 0 ? object.upper.x : object.lower.x, (i & 2) != 0 ? object.upper.y : object.lower.y,
                                 (i & 4) != 0 ? object.upper.z : object.lower.z}));
  }
}

/// The smallest power of two that is not below `x` > 0: exact, so that a scene scaled by a power of two gets the same
/// render space.
double power_of_two_above(double x) {
  int exponent = 0;
  const double mantissa = std::frexp(x, &exponent);  // in [1/2, 1)
  return std::ldexp(1.0, mantissa == 0.5 ? exponent - 1 : exponent);
}

void describe_surface(const SceneDescription& scene, const ShapeDescription& shape, const Materials& materials, SurfaceInfo& info) {
  info.material = shape.material;
  info.alpha = shape.alpha;
  info.is_boundary = shape.media.given;
  info.inside = shape.media.inside;
  info.outside = shape.media.outside;
  info.is_interface = shape.material == kNone || materials.is_interface(shape.material);
  info.has_alpha = shape.alpha.texture != kNone || shape.alpha.value < 1;
  if (!info.is_interface) {
    const MaterialKind& kind = scene.materials[static_cast<size_t>(shape.material)].kind;
    info.is_opaque = std::holds_alternative<DiffuseDescription>(kind) || std::holds_alternative<ConductorDescription>(kind) ||
                     std::holds_alternative<CoatedDiffuseDescription>(kind) || std::holds_alternative<CoatedConductorDescription>(kind);
  }
  const bool mix = !info.is_interface && std::holds_alternative<MixDescription>(scene.materials[static_cast<size_t>(shape.material)].kind);
  info.transparent_to_shadows = info.is_interface || info.has_alpha || mix;
}

/// Whether a path may pass through a medium that is not empty, so that lengths count.
bool has_media(const SceneDescription& scene, const Media& media) {
  const auto counts = [&](int medium) { return medium != kNone && !media[medium].is_vacuum(); };
  const auto bounds_medium = [&](const ShapeDescription& s) {
    return s.media.given && (counts(s.media.inside) || counts(s.media.outside));
  };
  return (scene.camera.media.given && counts(scene.camera.media.outside)) ||
         std::any_of(scene.shapes.begin(), scene.shapes.end(), bounds_medium) ||
         std::any_of(scene.objects.begin(), scene.objects.end(),
                     [&](const ObjectDescription& o) { return std::any_of(o.shapes.begin(), o.shapes.end(), bounds_medium); });
}

}  // namespace

RenderSpace choose_render_space(const SceneDescription& scene) {
  DBox box;
  for (const auto& s : scene.shapes) add_bounds(s, DMat4(1), box);
  for (const auto& i : scene.instances) {
    for (const auto& s : scene.objects[static_cast<size_t>(i.object)].shapes) add_bounds(s, i.world_from_instance, box);
  }
  if (box.empty()) {
    // Without shapes only the lights tell the size of the scene. Beside shapes a far lamp must not cost the scene its digits.
    for (const auto& l : scene.lights) {
      if (const auto* point = std::get_if<PointLightDescription>(&l.kind)) box.add(transform_point(l.world_from_light, point->position));
      if (const auto* spot = std::get_if<SpotLightDescription>(&l.kind)) box.add(transform_point(l.world_from_light, spot->from));
    }
  }
  const DVec3 eye = transform_point(scene.camera.world_from_camera, DVec3(0));
  box.add(eye);
  RenderSpace space;
  // The scene's size without the distance to the camera would let a far camera lose precision, so the eye counts.
  const double size = glm::length(box.upper - box.lower);
  space.scale = size > 0 && std::isfinite(size) ? 1 / power_of_two_above(size) : 1;
  const double grid = size > 0 && std::isfinite(size) ? power_of_two_above(size) / 4 : 1;
  for (int i = 0; i < 3; ++i) space.center[i] = std::round(eye[i] / grid) * grid;
  space.render_from_world = DMat4(1);
  for (int i = 0; i < 3; ++i) {
    space.render_from_world[i][i] = space.scale;
    space.render_from_world[3][i] = -space.scale * space.center[i];
  }
  space.world_from_render = DMat4(1);
  for (int i = 0; i < 3; ++i) {
    space.world_from_render[i][i] = 1 / space.scale;
    space.world_from_render[3][i] = space.center[i];
  }
  return space;
}

std::unique_ptr<const World> build_world(const SceneDescription& scene) {
  const RenderSpace space = choose_render_space(scene);
  std::vector<std::string> notes;
  size_t dropped = 0;

  std::vector<Shape> shapes;
  for (const auto& s : scene.shapes) shapes.push_back(compile_shape(s, space.render_from_world, dropped));
  const int top_level = static_cast<int>(shapes.size());

  // An object keeps a space of its own, centred on it, so that its vertices lose no digits wherever it was defined.
  std::vector<Geometry::Object> objects;
  std::vector<DMat4> definition_from_object;
  for (const auto& o : scene.objects) {
    DBox box;
    for (const auto& s : o.shapes) add_bounds(s, DMat4(1), box);
    const DVec3 center = box.empty() ? DVec3(0) : 0.5 * (box.lower + box.upper);
    DMat4 to_object(1), from_object(1);
    for (int i = 0; i < 3; ++i) {
      to_object[i][i] = space.scale;
      to_object[3][i] = -space.scale * center[i];
      from_object[i][i] = 1 / space.scale;
      from_object[3][i] = center[i];
    }
    objects.push_back({static_cast<int>(shapes.size()), static_cast<int>(o.shapes.size())});
    definition_from_object.push_back(from_object);
    for (const auto& s : o.shapes) shapes.push_back(compile_shape(s, to_object, dropped));
  }
  std::vector<Geometry::Instance> instances;
  for (const auto& i : scene.instances) {
    instances.push_back(
        {i.object, space.render_from_world * i.world_from_instance * definition_from_object[static_cast<size_t>(i.object)]});
  }
  if (dropped > 0) notes.push_back(std::to_string(dropped) + " triangles or patches without area were left out");

  Media media(scene, space.render_from_world, space.scale);
  const std::vector<Geometry::Object> placed_objects = objects;
  const std::vector<Geometry::Instance> placements = instances;
  const auto starts = has_media(scene, media) ? Geometry::Starts::kAnywhere : Geometry::Starts::kOnSurfaces;
  Geometry geometry(std::move(shapes), top_level, std::move(objects), std::move(instances), starts);
  const Box3 bounds = geometry.bounds();
  Lights lights(scene, geometry.shapes(), space.render_from_world, space.scale, bounds);
  auto world = std::unique_ptr<World>(new World{space,
                                                std::move(geometry),
                                                Textures(scene, space.world_from_render),
                                                {},
                                                {},
                                                std::move(lights),
                                                Camera(scene.camera, scene.film, space.render_from_world, space.scale),
                                                PixelFilter(scene.film.filter),
                                                {},
                                                kNone,
                                                std::nullopt,
                                                false,
                                                0,
                                                std::move(notes)});
  world->materials = Materials(scene, world->textures, space.scale);
  world->media = std::move(media);
  for (const auto& note : world->media.notes()) world->notes.push_back(note);
  for (const auto& note : world->textures.notes()) world->notes.push_back(note);
  for (const auto& note : world->lights.notes()) world->notes.push_back(note);

  const auto add_surface = [&](const ShapeDescription& s, int shape) {
    SurfaceInfo info;
    describe_surface(scene, s, world->materials, info);
    if (shape < top_level) info.light = world->lights.light_of_shape(shape);
    world->has_transparent_surfaces |= info.transparent_to_shadows;
    world->surfaces.push_back(info);
  };
  int index = 0;
  for (const auto& s : scene.shapes) add_surface(s, index++);
  for (const auto& o : scene.objects) {
    for (const auto& s : o.shapes) add_surface(s, index++);
  }

  std::vector<std::string> medium_names;
  for (const auto& m : scene.media) medium_names.push_back(m.name);
  find_overlaps(world->geometry, medium_names, world->surfaces);

  world->medium_around = find_medium_around(world->geometry, world->surfaces);
  const std::optional<int> found = find_medium(world->geometry, world->surfaces, world->camera.position());
  world->camera_medium = found.value_or(kNone);
  if (scene.camera.media.given) {
    world->camera_medium = scene.camera.media.outside;
    const auto name = [&](int medium) { return medium == kNone ? std::string() : scene.media[static_cast<size_t>(medium)].name; };
    if (found && *found != world->camera_medium) {
      world->notes.push_back("the camera's MediumInterface names the medium \"" + name(world->camera_medium) +
                             "\", but the boundaries around it say \"" + name(*found) + "\"; the camera's own word is used");
    }
  }
  if (!scene.camera.media.given && scene.camera.kind == CameraDescription::Kind::kOrthographic) {
    const auto [x0, x1, y0, y1] = scene.film.pixel_bounds;
    for (const DVec2 corner : {DVec2(x0, y0), DVec2(x1, y0), DVec2(x0, y1), DVec2(x1, y1)}) {
      const auto there = find_medium(world->geometry, world->surfaces, world->camera.ray(corner, Vec2(0.5f), 0).o);
      if (there.value_or(kNone) == world->camera_medium) continue;
      world->notes.push_back(
          "the orthographic camera's window lies in several media; all rays start in that of its centre: a MediumInterface before Camera "
          "says which one is meant");
      break;
    }
  }
  for (std::string& note : thin_media(*world, scene.film, medium_names)) world->notes.push_back(std::move(note));
  std::vector<double> powers;
  for (const int medium : reachable_media(scene, *world))
    if (const EmissionImportance* bricks = world->media[medium].emission_importance()) {
      world->emissive_media.push_back(medium);
      // One whose emission the estimate missed altogether may stand alone.
      powers.push_back(std::max(bricks->power(), std::numeric_limits<double>::min()));
    }
  world->emissive_choice = DiscreteDistribution(powers);
  std::vector<DVec3> light_positions;
  for (int i = 0; i < world->lights.size(); ++i)
    if (world->lights.bounded_pmf(i) > 0) light_positions.push_back(world->lights.position(i));
  // Light is sampled through smooth glass from area lights only.
  if (has_area_light(scene)) {
    const GlassScene glass{scene, world->geometry, world->surfaces, world->media, light_positions, top_level, placed_objects, placements};
    world->dielectric_spheres = find_dielectric_spheres(glass);
    world->dielectric_meshes = DielectricMeshes(glass);
  }
  world->effects = effect_bits(plan_effects(scene, *world));
  for (auto& note : scene_notes(scene, *world)) world->notes.push_back(std::move(note));
  return world;
}

}  // namespace woodcock
