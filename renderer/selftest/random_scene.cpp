#include "renderer/selftest/random_scene.h"

#include <algorithm>
#include <cmath>

#include "renderer/selftest/random_parts.h"

namespace woodcock::selftest {
namespace {

constexpr double kEnclosureRadius = 6;

/// Puts bodies, lights and the camera where there is room.
class SceneMaker {
 public:
  SceneMaker(RandomDraws& draw, bool furnace) : draw_(draw) { scene_.furnace = furnace; }

  Scene make() {
    choose_surroundings();
    const int wanted = 1 + draw_.weighted({2, 3, 3, 2, 1});
    for (int i = 0; i < wanted; ++i) add_something();
    if (!scene_.furnace) add_lights();
    place_camera();
    vary_spelling();
    return scene_;
  }

 private:
  Body& body(int i) { return scene_.bodies[static_cast<size_t>(i)]; }
  int count() const { return static_cast<int>(scene_.bodies.size()); }

  void choose_surroundings() {
    if (draw_.chance(0.5)) {
      Body walls;
      walls.enclosure = true;
      walls.form = random_closed_form(draw_);
      walls.radius = kEnclosureRadius;
      walls.material = random_opaque(draw_, 0.8);
      walls.two_sided = draw_.chance(0.5);
      walls.reversed = !walls.two_sided;
      turn(walls);
      if (!scene_.furnace) walls.emission = draw_.chance(0.5) ? draw_.colour(0.1, 1) : DVec3(0);
      scene_.bodies.push_back(walls);
      if (draw_.chance(0.5)) {
        scene_.medium = random_medium(draw_, {.homogeneous = draw_.chance(0.7), .absorbs = false, .least_depth = 1e-3});
        limit_depth(*scene_.medium, 30);
        scene_.medium->reach *= 3;
      }
    } else {
      const int skies = 1 + (draw_.chance(0.25) ? 1 : 0);
      const double share = skies == 1 ? 1 : draw_.uniform(0.05, 0.95);
      for (int i = 0; i < skies; ++i) {
        LightPart sky;
        sky.colour = scene_.furnace ? DVec3(i == 0 ? share : 1 - share) : draw_.colour(0.1, 1);
        scene_.lights.push_back(sky);
      }
      if (draw_.chance(0.1)) scene_.medium = random_medium(draw_, {.homogeneous = true, .absorbs = true, .least_depth = 0.1});
    }
    if (scene_.medium && !scene_.furnace) colour_emission(*scene_.medium);
  }

  static void limit_depth(MediumPart& medium, double most) {
    medium.depth = glm::min(medium.depth, DVec3(most));
    for (MediumPart& part : medium.parts) limit_depth(part, most);
  }

  void colour_emission(MediumPart& medium) {
    if (draw_.chance(0.3)) medium.emission = draw_.colour(0, 1);
    for (MediumPart& part : medium.parts) colour_emission(part);
  }

  void turn(Body& b) {
    b.detail = {draw_.uniform(0, 1), draw_.uniform(0, 1), draw_.uniform(0, 1)};
    b.axis = draw_.direction();
    b.angle = draw_.chance(0.2) ? 0 : draw_.uniform(0, 360);
    if (draw_.chance(0.2) && !b.enclosure) b.stretch = draw_.colour(0.3, 1);
    if (draw_.chance(0.1)) b.stretch[draw_.index(3)] *= -1;
  }

  /// The radius of the free ball inside a region.
  double room(int region) {
    if (region == kRoot) return 1;
    const Body& b = body(region);
    return b.radius * inscribed_radius(b.form) * std::min({std::abs(b.stretch.x), std::abs(b.stretch.y), std::abs(b.stretch.z)});
  }
  DVec3 center(int region) { return region == kRoot ? DVec3(0) : body(region).center; }

  /// Whether a ball touches no body but those around it. Sheets that others may cross do not count where `sheets_pass`.
  bool is_free(DVec3 at, double radius, int region, bool sheets_pass) {
    for (int i = 0; i < count(); ++i) {
      const Body& b = body(i);
      if (b.enclosure || i == region || stands_around(i, region)) continue;
      if (sheets_pass && (!is_closed(b.form) || !changes_index(b.material))) continue;
      if (glm::length(b.center - at) < b.radius + radius + 0.01 * std::min(radius, b.radius)) return false;
    }
    return true;
  }
  bool stands_around(int outer, int region) { return region != kRoot && stands_in(scene_, region, outer) && outer != kRoot; }

  /// A place for a ball in a region; false where there is none.
  bool find_place(Body& b, bool crosses) {
    std::vector<int> regions{kRoot, kRoot};
    for (int i = 0; i < count(); ++i)
      if (may_hold(i)) regions.insert(regions.end(), {i, i});
    for (int attempt = 0; attempt < 20; ++attempt) {
      const int region = regions[static_cast<size_t>(draw_.index(static_cast<int>(regions.size())))];
      const double size = room(region) * (draw_.chance(0.1) ? draw_.log_uniform(1e-3, 0.1) : draw_.uniform(0.15, 0.75));
      const double reach = crosses ? room(region) : 0.98 * (room(region) - size);
      const DVec3 at = center(region) + reach * draw_.in_ball();
      if (!is_free(at, size, region, crosses)) continue;
      if (crosses && region != kRoot) continue;
      b.parent = region;
      b.center = {RandomDraws::rounded(at.x), RandomDraws::rounded(at.y), RandomDraws::rounded(at.z)};
      b.radius = RandomDraws::rounded(size);
      return true;
    }
    return false;
  }

  /// Glass without a medium holds nothing: light that is reflected totally would stay in it for ever.
  bool may_hold(int i) {
    const Body& b = body(i);
    if (!is_region(b) || inscribed_radius(b.form) == 0) return false;
    return !traps(b.material) || b.medium.has_value();
  }
  static bool traps(const MaterialPart& m) { return changes_index(m) || m.form == MaterialForm::kThinGlass; }

  void add_something() {
    switch (draw_.weighted({4, 3, 2, 1})) {
      case 0:
        return add_region();
      case 1:
        return add_sheet();
      case 2:
        return add_solid();
      default:
        return add_touching();
    }
  }

  /// A medium for a body; where light is trapped it must scatter or absorb.
  MediumPart medium_for(const Body& b) {
    const bool trapped = traps(b.material);
    MediumPart medium = random_medium(draw_, {.homogeneous = trapped, .absorbs = false, .least_depth = trapped ? 0.3 : 1e-3});
    if (!scene_.furnace) colour_emission(medium);
    return medium;
  }

  void add_region() {
    Body b;
    b.form = random_closed_form(draw_);
    b.material = random_shell(draw_);
    if (!scene_.furnace && changes_index(b.material) && draw_.chance(0.3)) {
      b.material.form = MaterialForm::kRoughGlass;
      b.material.roughness = draw_.uniform(0.05, 0.5);
    }
    turn(b);
    if (!find_place(b, false)) return;
    b.has_boundary = true;
    if (b.material.form == MaterialForm::kInterface || draw_.chance(0.6)) b.medium = medium_for(b);
    if (!b.medium && draw_.chance(0.3)) b.has_boundary = medium_inside(scene_, b.parent) != nullptr;
    if (!b.medium && medium_inside(scene_, b.parent) != nullptr) b.has_boundary = true;
    if (changes_index(b.material) && !b.medium && draw_.chance(0.3)) {
      b.material.form = MaterialForm::kSubsurface;
      b.material.sigma_s = draw_.chance(0.3) ? draw_.colour(0.3, 8) : DVec3(draw_.log_uniform(0.3, 8));
      if (!scene_.furnace) b.material.sigma_a = draw_.colour(0, 1);
      b.has_boundary = medium_inside(scene_, b.parent) != nullptr;
    }
    scene_.bodies.push_back(b);
  }

  void add_sheet() {
    Body b;
    b.form = random_open_form(draw_);
    b.material = random_sheet(draw_);
    if (!scene_.furnace) other_material(b.material);
    turn(b);
    if (!find_place(b, draw_.chance(0.4))) return;
    if (draw_.chance(0.2)) b.alpha = draw_.uniform(0.2, 0.95);
    scene_.bodies.push_back(b);
  }

  void add_solid() {
    Body b;
    b.form = random_closed_form(draw_);
    b.material = random_opaque(draw_, draw_.chance(0.2) ? 1 : 0.9);
    if (!scene_.furnace) other_material(b.material);
    turn(b);
    if (!find_place(b, false)) return;
    b.two_sided = draw_.chance(0.4);
    scene_.bodies.push_back(b);
  }

  /// Two boxes that share a face, each with a medium or of glass.
  void add_touching() {
    Body left;
    left.form = Form::kLeftHalfBox;
    turn(left);
    left.stretch = DVec3(1);
    if (!find_place(left, false)) return;
    Body right = left;
    right.form = Form::kRightHalfBox;
    for (Body* b : {&left, &right}) {
      b->has_boundary = true;
      b->material.form = MaterialForm::kInterface;
      if (draw_.chance(0.4)) b->material = random_glass(draw_);
      if (b->material.form == MaterialForm::kInterface || draw_.chance(0.5)) b->medium = medium_for(*b);
      scene_.bodies.push_back(*b);
    }
  }

  /// Materials whose albedo is not known.
  void other_material(MaterialPart& material) {
    if (draw_.chance(0.5)) return;
    const auto form = draw_.pick({MaterialForm::kConductor, MaterialForm::kCoatedDiffuse, MaterialForm::kCoatedConductor});
    material = {};
    material.form = form;
    material.reflectance = draw_.colour(0.1, 0.9);
    material.roughness = draw_.chance(0.3) ? 0 : draw_.uniform(0.1, 0.6);
  }

  void add_lights() {
    // Surfaces that emit.
    for (Body& b : scene_.bodies) {
      const bool can = b.material.form == MaterialForm::kDiffuse || b.material.form == MaterialForm::kDiffuseTransmission;
      if (can && !b.enclosure && b.radius > 0.15 && draw_.chance(0.4)) b.emission = draw_.colour(0.2, 3);
    }
    const int others = draw_.weighted({2, 3, 1});
    for (int i = 0; i < others; ++i) add_small_light();
    const bool dark = scene_.lights.empty() &&
                      std::all_of(scene_.bodies.begin(), scene_.bodies.end(), [](const Body& b) { return b.emission == DVec3(0); });
    if (!dark) return;
    if (scene_.bodies.empty() || !scene_.bodies[0].enclosure) {
      scene_.lights.push_back({});
    } else {
      scene_.bodies[0].emission = DVec3(0.5);
    }
  }

  void add_small_light() {
    LightPart light;
    light.form = draw_.pick({LightForm::kPoint, LightForm::kSpot, LightForm::kDistant});
    light.colour = draw_.colour(0.2, 1);
    if (light.form == LightForm::kDistant) {
      if (!scene_.bodies.empty() && scene_.bodies[0].enclosure) return;
      if (scene_.medium) return;
      light.to = draw_.direction();
      scene_.lights.push_back(light);
      return;
    }
    Body bubble;
    bubble.material.form = MaterialForm::kInterface;
    bubble.has_boundary = true;
    if (!find_place(bubble, false)) return;
    // The nearer it may be approached the farther the light's square reaches.
    if (bubble.radius < 0.05) return;
    light.from = bubble.center;
    light.to = bubble.center + draw_.direction();
    light.cone = draw_.uniform(10, 80);
    light.edge = draw_.uniform(1, 10);
    scene_.bodies.push_back(bubble);
    scene_.lights.push_back(light);
  }

  void place_camera() {
    CameraPart& camera = scene_.camera;
    std::vector<int> regions{kRoot, kRoot};
    for (int i = 0; i < count(); ++i)
      if (may_hold(i)) regions.push_back(i);
    DVec3 eye(0, 0, 2);
    int region = kRoot;
    bool found = false;
    for (int attempt = 0; attempt < 30 && !found; ++attempt) {
      region = regions[static_cast<size_t>(draw_.index(static_cast<int>(regions.size())))];
      const double reach = region == kRoot ? 2.5 : 0.9 * room(region);
      eye = center(region) + reach * draw_.in_ball();
      found = is_free(eye, 0.01 * reach, region, false);
    }
    if (!found) region = kRoot, eye = DVec3(0.1, 0.2, 2.9);
    camera.region = region;
    camera.eye = {RandomDraws::rounded(eye.x), RandomDraws::rounded(eye.y), RandomDraws::rounded(eye.z)};
    int seen = kRoot;
    if (count() > 0 && draw_.chance(0.85)) seen = draw_.index(count());
    camera.target = seen == kRoot ? camera.eye + draw_.direction() : body(seen).center + 0.4 * body(seen).radius * draw_.in_ball();
    if (glm::length(camera.target - camera.eye) < 1e-3) camera.target = camera.eye + DVec3(0.3, 0.4, -0.8);
    camera.fov = draw_.uniform(5, 100);
    const bool open = scene_.bodies.empty() || !scene_.bodies[0].enclosure;
    if (region == kRoot && open && !scene_.medium && draw_.chance(0.25)) {
      // From far away.
      const double distance = draw_.log_uniform(3, 1e5);
      const DVec3 away = draw_.direction();
      camera.eye = {RandomDraws::rounded(distance * away.x), RandomDraws::rounded(distance * away.y),
                    RandomDraws::rounded(distance * away.z)};
      camera.fov = RandomDraws::rounded(2 * 57.29578 * std::atan(draw_.uniform(0.3, 1.5) / distance));
      if (count() == 0) camera.target = DVec3(0);
    } else if (region == kRoot && draw_.chance(0.1)) {
      camera.orthographic = true;
      camera.fov = 0.005;
    } else if (draw_.chance(0.1)) {
      camera.lens_radius = RandomDraws::rounded(0.003 * room(region));
      camera.focal_distance = draw_.uniform(0.3, 3);
    }
    camera.names_medium = draw_.chance(0.5) || camera.orthographic;
    // Boundaries do not say what lies around everything.
    if (region == kRoot && scene_.medium) camera.names_medium = true;
  }

  void vary_spelling() {
    for (Body& b : scene_.bodies) {
      const bool dark = emission_of(scene_, b) == DVec3(0);
      if (!b.enclosure && dark && draw_.chance(0.15)) b.instance = true;
      // The normal of glass says where its inside is.
      if (!b.enclosure && !changes_index(b.material) && (dark || b.two_sided) && draw_.chance(0.15)) b.reversed = true;
    }
    Placement& placement = scene_.placement;
    if (draw_.chance(0.4)) placement.scale = draw_.log_uniform(1e-5, 1e5);
    if (draw_.chance(0.3)) placement.offset = (placement.scale * draw_.log_uniform(1, 1e5)) * draw_.direction();
  }

  RandomDraws& draw_;
  Scene scene_;
};

}  // namespace

Scene random_furnace(RandomDraws& draw) { return SceneMaker(draw, true).make(); }

Scene random_open_scene(RandomDraws& draw) {
  Scene scene = SceneMaker(draw, false).make();
  scene.max_depth = draw.pick({1, 2, 3, 5, 8, 50});
  return scene;
}

}  // namespace woodcock::selftest
