#include "renderer/world/scene_notes.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <set>

#include "renderer/core/transform.h"
#include "renderer/world/media_overlap.h"

namespace woodcock {
namespace {

// --- reflectances

struct Reflectance {
  RgbParameter value;
  float scale = 1;
  const char* name;
};

std::vector<Reflectance> reflectances_of(const MaterialKind& kind) {
  if (const auto* d = std::get_if<DiffuseDescription>(&kind)) return {{d->reflectance, 1, "reflectance"}};
  if (const auto* d = std::get_if<DiffuseTransmissionDescription>(&kind))
    return {{d->reflectance, d->scale, "reflectance"}, {d->transmittance, d->scale, "transmittance"}};
  if (const auto* d = std::get_if<ConductorDescription>(&kind); d && d->reflectance) return {{*d->reflectance, 1, "reflectance"}};
  if (const auto* d = std::get_if<CoatedDiffuseDescription>(&kind))
    return {{d->reflectance, 1, "reflectance"}, {d->coat.albedo, 1, "albedo"}};
  if (const auto* d = std::get_if<CoatedConductorDescription>(&kind)) {
    std::vector<Reflectance> list{{d->coat.albedo, 1, "albedo"}};
    if (d->conductor.reflectance) list.push_back({*d->conductor.reflectance, 1, "reflectance"});
    return list;
  }
  return {};
}

/// Names of one material, once for each texture that is too bright.
void add_reflectances(const SceneDescription& scene, const World& world, std::vector<std::string>& notes) {
  // What rounding of the numbers in a file, and of products, may do.
  constexpr float kSlack = 1e-5f;
  std::set<std::pair<int, float>> seen;
  for (const MaterialDescription& material : scene.materials)
    for (const Reflectance& r : reflectances_of(material.kind)) {
      if (r.value.texture != kNone && !seen.insert({r.value.texture, r.scale}).second) continue;
      const TextureRange range = world.textures.range(r.value, r.scale);
      if (!(range.largest > 1 + kSlack)) continue;
      const std::string source =
          r.value.texture == kNone ? "" : fmt::format(" by texture \"{}\"", scene.rgb_textures[static_cast<size_t>(r.value.texture)].name);
      const std::string pixels =
          range.above_one == 0 ? "" : fmt::format(", and {} of {} pixels are above 1", range.above_one, range.pixels);
      notes.push_back(fmt::format("{}: the {}{} reaches {:.6g}{}; what is above 1 is cut to 1", place_of(material.where), r.name, source,
                                  range.largest, pixels));
    }
}

// --- quadrics that a mirror turned inside out

bool is_closed_kind(const ShapeKind& kind) {
  return std::holds_alternative<SphereDescription>(kind) || std::holds_alternative<CylinderDescription>(kind);
}

/// Whether what lies around the shape agrees with the medium that its turned sides give to the outside.
bool surroundings_agree(const World& world, int shape, int outer) {
  const Vec3 center = bounds_of(world.geometry.shapes()[static_cast<size_t>(shape)]).center();
  const auto crossings = crossings_along(world, {center, glm::normalize(Vec3(0.291f, 0.815f, 0.501f))}).list;
  const auto own = std::find_if(crossings.begin(), crossings.end(), [&](const BoundaryCrossing& c) { return c.shape == shape; });
  return own != crossings.end() && own + 1 != crossings.end() && (own + 1)->near == outer;
}

bool side_matters(const SceneDescription& scene, const World& world, const ShapeDescription& s, int shape, bool top_level) {
  if (s.area_light && !s.area_light->two_sided) return true;
  const auto* glass = std::get_if<DielectricDescription>(&scene.materials[static_cast<size_t>(s.material)].kind);
  if (glass != nullptr && glass->eta != 1) return true;
  if (!s.media.given || s.media.inside == s.media.outside) return false;
  // What the scene calls inside is now around the shape.
  const int outer = s.media.inside;
  if (scene.camera.media.given && scene.camera.media.outside == outer) return false;
  return outer != kNone && !(top_level && surroundings_agree(world, shape, outer));
}

void add_mirrored(const SceneDescription& scene, const World& world, std::vector<std::string>& notes) {
  size_t count = 0;
  const ShapeDescription* first = nullptr;
  int index = 0;
  const auto look_at = [&](const ShapeDescription& s, bool top_level) {
    const int shape = index++;
    if (!is_closed_kind(s.kind) || s.reverse_orientation || !(glm::determinant(glm::dmat3(s.world_from_object)) < 0)) return;
    if (s.material == kNone || !side_matters(scene, world, s, shape, top_level)) return;
    if (count++ == 0) first = &s;
  };
  for (const ShapeDescription& s : scene.shapes) look_at(s, true);
  for (const ObjectDescription& o : scene.objects)
    for (const ShapeDescription& s : o.shapes) look_at(s, false);
  if (first != nullptr)
    notes.push_back(
        fmt::format("{}: a transform that mirrors turns this sphere or cylinder inside out{}: its normal points inwards, so the sides of "
                    "its MediumInterface, of its glass and of its light are exchanged (as in pbrt-v4); ReverseOrientation before Shape "
                    "turns it back",
                    place_of(first->where), count > 1 ? fmt::format(", and {} others", count - 1) : ""));
}

// --- instances whose grids stay behind

using Corners = std::array<DVec3, 8>;

Corners corners_of(DVec3 lower, DVec3 upper, const DMat4& m) {
  Corners corners;
  for (size_t i = 0; i < 8; ++i)
    corners[i] = transform_point(m, {(i & 1) != 0 ? upper.x : lower.x, (i & 2) != 0 ? upper.y : lower.y, (i & 4) != 0 ? upper.z : lower.z});
  return corners;
}

/// The boxes of the grids of a medium, in world space.
void add_boxes(const SceneDescription& scene, int index, std::vector<Corners>& boxes) {
  const MediumDescription& medium = scene.media[static_cast<size_t>(index)];
  const DMat4& m = medium.world_from_medium;
  if (const auto* sum = std::get_if<SumMediumDescription>(&medium.kind)) {
    for (const int part : sum->media) add_boxes(scene, part, boxes);
  } else if (const auto* grid = std::get_if<GridMediumDescription>(&medium.kind)) {
    if (const auto* dense = std::get_if<DenseGrid<float>>(grid->density.get())) {
      boxes.push_back(corners_of(dense->p0, dense->p1, m));
    } else {
      const auto& sparse = std::get<SparseGrid>(*grid->density);
      if (sparse.index_max.x >= sparse.index_min.x)
        boxes.push_back(corners_of(DVec3(sparse.index_min), DVec3(sparse.index_max + 1), m * sparse.medium_from_index));
    }
  } else if (const auto* rgb = std::get_if<RgbGridMediumDescription>(&medium.kind)) {
    const RgbVolume& volume = rgb->sigma_a ? *rgb->sigma_a : *rgb->sigma_s;
    boxes.push_back(corners_of(volume.p0, volume.p1, m));
  } else if (const auto* cloud = std::get_if<CloudMediumDescription>(&medium.kind)) {
    boxes.push_back(corners_of(cloud->p0, cloud->p1, m));
  }
}

struct Extent {
  DVec3 lower{std::numeric_limits<double>::infinity()}, upper{-std::numeric_limits<double>::infinity()};
  void add(DVec3 p) {
    lower = glm::min(lower, p);
    upper = glm::max(upper, p);
  }
  double size() const { return glm::length(upper - lower); }
};

Extent extent_of(const Corners& corners) {
  Extent extent;
  for (const DVec3 p : corners) extent.add(p);
  return extent;
}

/// The box of a shape in the space of its object.
Extent extent_of(const ShapeDescription& shape) {
  Extent object;
  const auto add_mesh = [&](const auto& mesh) {
    for (const DVec3 p : mesh->positions) object.add(p);
  };
  if (const auto* mesh = std::get_if<std::shared_ptr<const TriangleMesh>>(&shape.kind)) add_mesh(*mesh);
  if (const auto* mesh = std::get_if<std::shared_ptr<const BilinearMesh>>(&shape.kind)) add_mesh(*mesh);
  const auto add_round = [&](double r, double z0, double z1) {
    object.add({-r, -r, z0});
    object.add({r, r, z1});
  };
  if (const auto* s = std::get_if<SphereDescription>(&shape.kind)) add_round(s->radius, s->z_min, s->z_max);
  if (const auto* d = std::get_if<DiskDescription>(&shape.kind)) add_round(d->radius, d->height, d->height);
  if (const auto* c = std::get_if<CylinderDescription>(&shape.kind)) add_round(c->radius, c->z_min, c->z_max);
  return extent_of(corners_of(object.lower, object.upper, shape.world_from_object));
}

/// Whether an instance moves a boundary away from the grid that it was defined around. A grid that holds the whole of the boundary
/// everywhere is seen through windows, and is right.
bool leaves_behind(const Corners& box, const Extent& shape, const DMat4& world_from_instance) {
  const Extent grid = extent_of(box);
  double moved = 0;
  for (const DVec3 p : box) moved = std::max(moved, glm::length(transform_point(world_from_instance, p) - p));
  if (moved <= 1e-6 * grid.size()) return false;
  const Extent placed = extent_of(corners_of(shape.lower, shape.upper, world_from_instance));
  const double slack = 1e-6 * grid.size();
  const bool covered =
      glm::all(glm::lessThanEqual(grid.lower - slack, placed.lower)) && glm::all(glm::lessThanEqual(placed.upper, grid.upper + slack));
  return !covered;
}

void add_grids_left_behind(const SceneDescription& scene, std::vector<std::string>& notes) {
  if (scene.instances.empty()) return;
  for (size_t o = 0; o < scene.objects.size(); ++o) {
    const ObjectDescription& object = scene.objects[o];
    std::set<int> said;
    for (const ShapeDescription& shape : object.shapes) {
      if (!shape.media.given) continue;
      for (const int medium : {shape.media.inside, shape.media.outside}) {
        if (medium == kNone || said.contains(medium)) continue;
        std::vector<Corners> boxes;
        add_boxes(scene, medium, boxes);
        if (boxes.empty()) continue;
        const Extent extent = extent_of(shape);
        size_t all = 0, left = 0;
        for (const InstanceDescription& i : scene.instances) {
          if (i.object != static_cast<int>(o)) continue;
          ++all;
          left += std::any_of(boxes.begin(), boxes.end(),
                              [&](const Corners& box) { return leaves_behind(box, extent, i.world_from_instance); });
        }
        if (left == 0) continue;
        said.insert(medium);
        notes.push_back(
            fmt::format("{}: the grid of the medium \"{}\" stays where MakeNamedMedium placed it, but {} of {} instances of \"{}\" "
                        "move its boundary elsewhere (as in pbrt-v4); define a medium for each place",
                        place_of(shape.where), scene.media[static_cast<size_t>(medium)].name, left, all, object.name));
      }
    }
  }
}

}  // namespace

std::string place_of(const SourceLocation& where) { return fmt::format("{}:{}:{}", where.file, where.line, where.column); }

std::vector<std::string> scene_notes(const SceneDescription& scene, const World& world) {
  std::vector<std::string> notes;
  add_reflectances(scene, world, notes);
  add_mirrored(scene, world, notes);
  add_grids_left_behind(scene, notes);
  if (std::string note = note_on_overlap(scene, world); !note.empty()) notes.push_back(std::move(note));
  return notes;
}

}  // namespace woodcock
