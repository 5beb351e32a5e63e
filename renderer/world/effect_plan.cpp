#include "renderer/world/effect_plan.h"

#include <functional>
#include <set>

namespace woodcock {
namespace {

/// The objects that an instance places.
std::set<int> placed_objects(const SceneDescription& scene) {
  std::set<int> placed;
  for (const auto& i : scene.instances) placed.insert(i.object);
  return placed;
}

/// The media that some ray can be in.
std::set<int> reachable_media(const SceneDescription& scene, const World& world) {
  std::set<int> reachable;
  const auto add = [&](int medium) {
    if (medium != kNone) reachable.insert(medium);
  };
  const auto add_boundary = [&](const ShapeDescription& s) {
    if (!s.media.given) return;
    add(s.media.inside);
    add(s.media.outside);
  };
  for (const auto& s : scene.shapes) add_boundary(s);
  for (const int o : placed_objects(scene)) {
    for (const auto& s : scene.objects[static_cast<size_t>(o)].shapes) add_boundary(s);
  }
  add(world.camera_medium);
  return reachable;
}

class Planner {
 public:
  Planner(const SceneDescription& scene, const World& world) : scene_(scene), world_(world), media_(reachable_media(scene, world)) {}

  std::vector<EffectEntry> plan() {
    medium("homogeneous media", "has the same coefficients everywhere",
           [](const Medium& m) { return m.is_homogeneous() && m.attenuates(); });
    medium("heterogeneous media", "varies in space", [](const Medium& m) { return !m.is_homogeneous() && m.attenuates(); });
    medium("volume scattering", "scatters", [](const Medium& m) { return m.scatters(); });
    medium("volume emission", "emits", [](const Medium& m) { return m.emits(); });
    medium("chromatic extinction", "attenuates channels differently", [](const Medium& m) { return !m.is_grey(); });
    surface("index-matched interfaces", "is a boundary without a surface", [&](const ShapeDescription& s) { return is_interface(s); });
    surface("surfaces", "has a material", [&](const ShapeDescription& s) { return !is_interface(s); });
    surface("surfaces other than diffuse", "has a material that is not diffuse", [&](const ShapeDescription& s) {
      return !is_interface(s) && !std::holds_alternative<DiffuseDescription>(scene_.materials[static_cast<size_t>(s.material)].kind);
    });
    surface("partial opacity", "has an alpha below one",
            [](const ShapeDescription& s) { return s.alpha.texture != kNone || s.alpha.value < 1; });
    surface("area lights", "emits",
            [](const ShapeDescription& s) { return s.area_light && s.area_light->scale > 0 && !is_black(s.area_light->radiance); });
    light<InfiniteLightDescription>("environment lights", "an infinite light");
    light<DistantLightDescription>("distant lights", "a distant light");
    light<PointLightDescription>("point lights", "a point light");
    light<SpotLightDescription>("spot lights", "a spot light");
    const bool lens = scene_.camera.lens_radius > 0;
    entries_.push_back({"thin lens", lens, lens ? "the camera has a lens radius" : "the camera is a pinhole",
                        lens ? scene_.camera.where : SourceLocation{}});
    const bool instances = !scene_.instances.empty();
    entries_.push_back({"instances", instances,
                        instances ? std::to_string(scene_.instances.size()) + " objects are placed" : "no object is placed",
                        instances ? scene_.instances.front().where : SourceLocation{}});
    return std::move(entries_);
  }

 private:
  bool is_interface(const ShapeDescription& s) const { return s.material == kNone || world_.materials.is_interface(s.material); }

  void medium(const std::string& effect, const std::string& does, const std::function<bool(const Medium&)>& test) {
    for (const int m : media_) {
      if (!test(world_.media[m])) continue;
      const auto& description = scene_.media[static_cast<size_t>(m)];
      entries_.push_back({effect, true, "the medium \"" + description.name + "\" " + does, description.where});
      return;
    }
    const bool declared = scene_.media.size() > media_.size();
    entries_.push_back(
        {effect, false, std::string("no medium that a ray can reach ") + does + (declared ? " (some are declared and not used)" : ""), {}});
  }

  void surface(const std::string& effect, const std::string& does, const std::function<bool(const ShapeDescription&)>& test) {
    const auto check = [&](const ShapeDescription& s) {
      if (!test(s)) return false;
      entries_.push_back({effect, true, "a shape " + does, s.where});
      return true;
    };
    for (const auto& s : scene_.shapes) {
      if (check(s)) return;
    }
    for (const int o : placed_objects(scene_)) {
      for (const auto& s : scene_.objects[static_cast<size_t>(o)].shapes) {
        if (check(s)) return;
      }
    }
    entries_.push_back({effect, false, "no shape " + does, {}});
  }

  template <typename Kind>
  void light(const std::string& effect, const std::string& what) {
    bool dark = false;
    for (const auto& l : scene_.lights) {
      const auto* kind = std::get_if<Kind>(&l.kind);
      if (kind == nullptr) continue;
      if (is_black(emitted(*kind))) {
        dark = true;
        continue;
      }
      entries_.push_back({effect, true, "the scene has " + what, l.where});
      return;
    }
    entries_.push_back({effect, false, dark ? "the scene has none that shines" : "the scene has none", {}});
  }
  static Rgb emitted(const PointLightDescription& l) { return l.intensity; }
  static Rgb emitted(const SpotLightDescription& l) { return l.intensity; }
  static Rgb emitted(const DistantLightDescription& l) { return l.radiance; }
  static Rgb emitted(const InfiniteLightDescription& l) { return l.radiance; }

  const SceneDescription& scene_;
  const World& world_;
  std::set<int> media_;
  std::vector<EffectEntry> entries_;
};

}  // namespace

std::vector<EffectEntry> plan_effects(const SceneDescription& scene, const World& world) { return Planner(scene, world).plan(); }

}  // namespace woodcock
