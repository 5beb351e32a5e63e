#include "renderer/selftest/coverage.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace woodcock::selftest {
namespace {

using Names = std::set<std::string>;

double largest(DVec3 v) { return std::max({v.x, v.y, v.z}); }

/// The decade as "1e-3".
std::string decade(double value) {
  return value > 0 ? fmt::format("1e{:+d}", static_cast<int>(std::floor(std::log10(value * 1.0000001)))) : "0";
}

std::string group_of(const std::string& feature) { return feature.substr(0, feature.find('/')); }

void add_medium(const MediumPart& medium, bool inside_sum, Names& names) {
  names.insert(fmt::format("medium/{}{}", name_of(medium.form), inside_sum ? " in a sum" : ""));
  if (medium.form == MediumForm::kSum) {
    for (const MediumPart& part : medium.parts) add_medium(part, true, names);
    return;
  }
  names.insert("phase/" + (medium.albedo == DVec3(0) ? "none" : medium.phase.kind));
  names.insert("optical depth/" + decade(largest(medium.depth)));
  if (medium.depth.x != medium.depth.y || medium.depth.y != medium.depth.z) names.insert("medium/extinction by channel");
  if (medium.depth.x * medium.depth.y * medium.depth.z == 0) names.insert("medium/a channel without extinction");
  if (medium.albedo.x != medium.albedo.y || medium.albedo.y != medium.albedo.z) names.insert("medium/albedo by channel");
  if (medium.emission_grid) names.insert("medium/emission grid");
  const double albedo = largest(medium.albedo);
  names.insert(albedo == 0     ? "medium albedo/0"
               : albedo == 1   ? "medium albedo/1"
               : albedo < 0.5  ? "medium albedo/below 0.5"
               : albedo < 0.95 ? "medium albedo/0.5 to 0.95"
                               : "medium albedo/above 0.95");
}

void add_body(const Scene& scene, const Body& body, Names& names) {
  names.insert(fmt::format("shape/{}", name_of(body.form)));
  names.insert(fmt::format("material/{}", name_of(body.material.form)));
  for (const MaterialPart& part : body.material.mixed) names.insert(fmt::format("material/{} in a mix", name_of(part.form)));
  if (emission_of(scene, body) != DVec3(0))
    names.insert(fmt::format("light/{}{}", name_of(body.form),
                             body.two_sided   ? ", two-sided"
                             : body.enclosure ? ", inwards"
                                              : ", outwards"));
  if (body.enclosure) {
    names.insert("place/enclosure");
    return;
  }
  if (body.medium) add_medium(*body.medium, false, names);
  if (body.medium && changes_index(body.material)) names.insert("place/medium in glass");
  if (body.parent != kRoot) {
    const Body& parent = scene.bodies[static_cast<size_t>(body.parent)];
    names.insert(changes_index(parent.material) ? "place/in glass" : "place/nested");
    if (parent.medium && body.medium) names.insert("place/medium in medium");
    if (parent.medium && emission_of(scene, body) != DVec3(0)) names.insert("place/light in medium");
  }
  if (body.alpha < 1) names.insert("shape/alpha");
  if (body.instance) names.insert("shape/instance");
  if (body.reversed) names.insert("shape/reversed");
  if (body.stretch != DVec3(1)) names.insert(body.stretch.x * body.stretch.y * body.stretch.z < 0 ? "shape/mirrored" : "shape/stretched");
  const double size = body.radius / (body.parent == kRoot ? 1 : scene.bodies[static_cast<size_t>(body.parent)].radius);
  names.insert("relative size/" + decade(size));
}

}  // namespace

std::vector<std::string> features_of(const Case& c) {
  Names names;
  const Scene& scene = c.scene;
  names.insert(fmt::format("relation/{}", name_of(c.relation)));
  for (const Body& body : scene.bodies) add_body(scene, body, names);
  if (scene.medium) {
    add_medium(*scene.medium, false, names);
    names.insert("place/medium around everything");
  }
  int skies = 0;
  for (const LightPart& light : scene.lights) {
    names.insert(fmt::format("light/{}", name_of(light.form)));
    skies += light.form == LightForm::kInfinite ? 1 : 0;
  }
  if (skies > 1) names.insert("light/two infinite");
  const CameraPart& camera = scene.camera;
  if (camera.region == kRoot) {
    names.insert(scene.medium ? "camera/in the medium around everything" : "camera/in vacuum");
  } else {
    const Body& region = scene.bodies[static_cast<size_t>(camera.region)];
    names.insert(index_inside(scene, camera.region) != 1 ? "camera/in glass" : region.medium ? "camera/in a medium" : "camera/in a hollow");
  }
  if (camera.orthographic) names.insert("camera/orthographic");
  if (camera.lens_radius > 0) names.insert("camera/lens");
  if (const double distance = glm::length(camera.eye); distance >= 3) names.insert("camera distance/" + decade(distance));
  if (!camera.names_medium) names.insert("camera/medium found");
  if (scene.placement.scale != 1) names.insert("scale/" + decade(scene.placement.scale));
  if (scene.placement.offset != DVec3(0)) names.insert("offset/" + decade(glm::length(scene.placement.offset) / scene.placement.scale));
  if (c.rendering.estimator != "auto") names.insert("rendering/" + c.rendering.estimator);
  if (!c.rendering.without.empty()) names.insert("rendering/without " + c.rendering.without);
  if (!c.rendering.plan) names.insert("rendering/plan off");
  if (c.rendering.full_kernel) names.insert("rendering/full kernel");
  return {names.begin(), names.end()};
}

void Coverage::add(const std::vector<std::string>& features) {
  for (size_t i = 0; i < features.size(); ++i) {
    ++features_[features[i]];
    for (size_t j = i + 1; j < features.size(); ++j) ++pairs_[std::minmax(features[i], features[j])];
  }
}

int64_t Coverage::pair(const std::string& a, const std::string& b) const {
  const auto found = pairs_.find(std::minmax(a, b));
  return found == pairs_.end() ? 0 : found->second;
}

int64_t Coverage::pairs_possible() const {
  const auto n = static_cast<int64_t>(features_.size());
  return n * (n - 1) / 2;
}

std::string Coverage::table() const {
  std::string text = fmt::format("{:<48} {:>8}  {:>22}\n", "feature", "scenes", "pairs with it (of all)");
  for (const auto& [name, count] : features_) {
    int64_t partners = 0;
    for (const auto& other : features_) partners += other.first != name && pair(name, other.first) > 0 ? 1 : 0;
    text += fmt::format("{:<48} {:>8}  {:>10} of {}\n", name, count, partners, features_.size() - 1);
  }
  text += fmt::format("\n{:<40} {:>16}  {:>12}\n", "groups", "pairs covered", "median count");
  std::map<std::pair<std::string, std::string>, std::vector<int64_t>> groups;
  for (auto a = features_.begin(); a != features_.end(); ++a)
    for (auto b = std::next(a); b != features_.end(); ++b)
      groups[std::minmax(group_of(a->first), group_of(b->first))].push_back(pair(a->first, b->first));
  for (auto& [names, counts] : groups) {
    std::sort(counts.begin(), counts.end());
    const auto covered = std::count_if(counts.begin(), counts.end(), [](int64_t n) { return n > 0; });
    text += fmt::format("{:<40} {:>7} of {:<6}  {:>12}\n", names.first + " and " + names.second, covered, counts.size(),
                        counts[counts.size() / 2]);
  }
  return text + fmt::format("\n{} features, {} of {} pairs\n", features_.size(), pairs_covered(), pairs_possible());
}

}  // namespace woodcock::selftest
