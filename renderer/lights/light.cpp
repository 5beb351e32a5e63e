#include "renderer/lights/light.h"

#include <algorithm>

#include "renderer/lights/light_table.h"
#include "renderer/scene/scene_error.h"

namespace woodcock {
namespace {

template <typename... F>
struct Overloaded : F... {
  using F::operator()...;
};

/// A part of the choices ignores power: the power of a distant or infinite light depends on the size of the scene,
/// and without this part a far-away ground plane would starve every small lamp.
constexpr double kUniformShare = 0.2;

void fill_choice(LightTable& table) {
  double total = 0;
  int shining = 0;
  for (const Rgb& power : table.power) {
    total += static_cast<double>(average(power));
    shining += average(power) > 0;
  }
  double sum = 0;
  for (const Rgb& power : table.power) {
    const double p = static_cast<double>(average(power));
    const double choice = !(total > 0) ? 1.0 / static_cast<double>(table.power.size())
                          : p > 0      ? (1 - kUniformShare) * p / total + kUniformShare / shining
                                       : 0.0;
    sum += choice;
    table.pmf.push_back(static_cast<float>(choice));
    table.cdf.push_back(sum);
  }
}

float bounding_radius(Box3 bounds) {
  // An empty scene has no size; any positive radius keeps the choice of lights defined.
  if (bounds.empty()) return 1;
  const float radius = 0.5f * glm::length(bounds.extent());
  return radius > 0 && std::isfinite(radius) ? radius : 1;
}

}  // namespace

Lights::Lights() : table_(std::make_shared<LightTable>()) {}

Lights::Lights(const SceneDescription& description, const std::vector<Shape>& /*shapes*/, const DMat4& render_from_world, double scale,
               Box3 bounds) {
  auto table = std::make_shared<LightTable>();
  const float radius = bounding_radius(bounds);
  const auto add = [&](Light light, const SourceLocation& where) {
    table->power.push_back(std::visit([](const auto& l) { return l.power(); }, light));
    table->where.push_back(where);
    table->lights.push_back(std::move(light));
  };
  for (const LightDescription& light : description.lights) {
    std::visit(Overloaded{
                   [&](const PointLightDescription& l) { add(PointLight(light, l, render_from_world, scale), light.where); },
                   [&](const SpotLightDescription& l) { add(SpotLight(light, l, render_from_world, scale), light.where); },
                   [&](const DistantLightDescription& l) { add(DistantLight(light, l, render_from_world, radius), light.where); },
                   [&](const InfiniteLightDescription& l) {
                     table->infinite.push_back(static_cast<int>(table->lights.size()));
                     add(InfiniteLight(light, l, render_from_world, radius), light.where);
                   },
               },
               light.kind);
  }
  for (const ShapeDescription& shape : description.shapes)
    if (shape.area_light) throw SceneError(shape.where, "found an area light, expected a light that is no shape");
  fill_choice(*table);
  table_ = std::move(table);
}

int Lights::size() const { return static_cast<int>(table_->lights.size()); }

std::optional<Lights::Choice> Lights::choose(float u) const {
  const std::vector<double>& cdf = table_->cdf;
  if (cdf.empty()) return std::nullopt;
  const double target = static_cast<double>(u) * cdf.back();
  const auto it = std::upper_bound(cdf.begin(), cdf.end() - 1, target);
  const int light = static_cast<int>(it - cdf.begin());
  return Choice{light, table_->pmf[static_cast<size_t>(light)]};
}

float Lights::pmf(int light) const { return table_->pmf[static_cast<size_t>(light)]; }

std::optional<LightSample> Lights::sample(int light, Vec3 ref, Vec2 u, float u_primitive) const {
  return std::visit([&](const auto& l) { return l.sample(ref, u, u_primitive); }, table_->lights[static_cast<size_t>(light)]);
}

int Lights::light_of_shape(int shape) const {
  return table_->light_of_shape.empty() ? kNone : table_->light_of_shape[static_cast<size_t>(shape)];
}

Rgb Lights::emitted(int /*light*/, const EmitterHit& /*hit*/, Vec3 /*wo*/) const { return Rgb(0); }

float Lights::pdf(int /*light*/, Vec3 /*ref*/, const EmitterHit& /*hit*/, Vec3 /*wi*/) const { return 0; }

Rgb Lights::environment(Vec3 direction) const {
  Rgb sum(0);
  for (int i : table_->infinite) sum += std::get<InfiniteLight>(table_->lights[static_cast<size_t>(i)]).radiance(direction);
  return sum;
}

float Lights::environment_pdf(Vec3 direction) const {
  float sum = 0;
  for (int i : table_->infinite) sum += pmf(i) * std::get<InfiniteLight>(table_->lights[static_cast<size_t>(i)]).pdf(direction);
  return sum;
}

bool Lights::has_environment() const { return !table_->infinite.empty(); }

Rgb Lights::power(int light) const { return table_->power[static_cast<size_t>(light)]; }

const SourceLocation& Lights::where(int light) const { return table_->where[static_cast<size_t>(light)]; }

}  // namespace woodcock
