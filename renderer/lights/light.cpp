#include "renderer/lights/light.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

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

std::vector<double> choice_weights(const std::vector<double>& powers) {
  double total = 0;
  int shining = 0;
  for (const double power : powers) {
    total += power;
    shining += power > 0;
  }
  std::vector<double> weights;
  for (const double p : powers) weights.push_back(p > 0 ? (1 - kUniformShare) * p / total + kUniformShare / shining : 0.0);
  return weights;
}

/// What a choice can go by, of an amount of light that may have overflowed.
double finite(double light) { return std::isfinite(light) ? std::max(light, 0.0) : static_cast<double>(std::numeric_limits<float>::max()); }

/// The power of what is sampled: of a sky, what MIS compensation leaves.
double sampled_power(const Light& light, double radius) {
  if (const auto* sky = std::get_if<InfiniteLight>(&light))
    return 4 * std::numbers::pi * std::numbers::pi * radius * radius * sky->sampled_radiance();
  return finite(static_cast<double>(average(std::visit([](const auto& l) { return l.power(); }, light))));
}

LightSelection::Candidate candidate(LightBounds bounds) {
  bounds.intensity = finite(bounds.intensity);
  return {bounds, 0};
}

DVec3 center_of(const Shape& shape) { return DVec3(bounds_of(shape).center()); }

float bounding_radius(Box3 bounds) {
  // An empty scene has no size; any positive radius keeps the choice of lights defined.
  if (bounds.empty()) return 1;
  const float radius = 0.5f * glm::length(bounds.extent());
  return radius > 0 && std::isfinite(radius) ? radius : 1;
}

}  // namespace

Lights::Lights() : table_(std::make_shared<LightTable>()) {}

Lights::Lights(const SceneDescription& description, const std::vector<Shape>& shapes, const DMat4& render_from_world, double scale,
               Box3 bounds) {
  auto table = std::make_shared<LightTable>();
  const float radius = bounding_radius(bounds);
  const auto add = [&](Light light, const SourceLocation& where, std::optional<DVec3> position = std::nullopt) {
    table->position.push_back(position);
    table->power.push_back(std::visit([](const auto& l) { return l.power(); }, light));
    table->where.push_back(where);
    table->lights.push_back(std::move(light));
  };
  for (const LightDescription& light : description.lights) {
    std::visit(Overloaded{
                   [&](const PointLightDescription& l) {
                     const PointLight point(light, l, render_from_world, scale);
                     add(point, light.where, point.position());
                   },
                   [&](const SpotLightDescription& l) {
                     const SpotLight spot(light, l, render_from_world, scale);
                     add(spot, light.where, spot.position());
                   },
                   [&](const DistantLightDescription& l) { add(DistantLight(light, l, render_from_world, radius), light.where); },
                   [&](const InfiniteLightDescription& l) {
                     table->infinite.push_back(static_cast<int>(table->lights.size()));
                     add(InfiniteLight(light, l, render_from_world, radius), light.where);
                   },
               },
               light.kind);
  }
  table->light_of_shape.assign(description.shapes.size(), kNone);
  for (size_t i = 0; i < description.shapes.size(); ++i) {
    const ShapeDescription& shape = description.shapes[i];
    if (!shape.area_light) continue;
    table->light_of_shape[i] = static_cast<int>(table->lights.size());
    add(AreaLight(shape, static_cast<int>(i), shapes[i], scale), shape.where, center_of(shapes[i]));
  }
  for (const ObjectDescription& object : description.objects)
    for (const ShapeDescription& shape : object.shapes)
      if (shape.area_light)
        throw SceneError(shape.where,
                         "found an area light in the object \"" + object.name + "\", expected one on a shape outside of objects");
  std::vector<double> powers;
  for (const Light& light : table->lights) powers.push_back(sampled_power(light, static_cast<double>(radius)));
  const std::vector<double> weights = choice_weights(powers);
  std::vector<double> bounded = weights;
  for (size_t i = 0; i < bounded.size(); ++i)
    if (!table->position[i]) bounded[i] = 0;
  table->choice = DiscreteDistribution(weights);
  table->bounded_choice = DiscreteDistribution(bounded);
  std::vector<LightSelection::Candidate> candidates;
  for (const Light& light : table->lights)
    candidates.push_back(
        std::visit(Overloaded{
                       [](const DistantLight& l) {
                         return LightSelection::Candidate{std::nullopt, finite(l.irradiance())};
                       },
                       [](const InfiniteLight& l) {
                         return LightSelection::Candidate{std::nullopt, finite(4 * std::numbers::pi * l.sampled_radiance())};
                       },
                       [&](const AreaLight& l) { return candidate(l.bounds(bounds_of(shapes[static_cast<size_t>(l.shape())]))); },
                       [](const auto& l) { return candidate(l.bounds()); },
                   },
                   light));
  table->selection = LightSelection(candidates);
  table_ = std::move(table);
}

int Lights::size() const { return static_cast<int>(table_->lights.size()); }

std::optional<Lights::Choice> Lights::choose(double u, DVec3 ref, ChooseBy by) const {
  if (by == ChooseBy::kArrival) {
    const auto chosen = table_->selection.choose(u, ref);
    return chosen ? std::optional(Choice{chosen->light, static_cast<float>(chosen->probability)}) : std::nullopt;
  }
  if (!(table_->choice.total() > 0)) return std::nullopt;
  const int light = static_cast<int>(table_->choice.sample(u).index);
  return Choice{light, pmf(light, ref, by)};
}

std::optional<Lights::Choice> Lights::only_choice(ChooseBy by) const {
  for (int light = 0; light < size(); ++light)
    if (by == ChooseBy::kArrival ? table_->selection.only() == light : table_->choice.probability(static_cast<size_t>(light)) == 1)
      return Choice{light, 1};
  return std::nullopt;
}

float Lights::pmf(int light, DVec3 ref, ChooseBy by) const {
  return static_cast<float>(by == ChooseBy::kArrival ? table_->selection.probability(light, ref)
                                                     : table_->choice.probability(static_cast<size_t>(light)));
}

bool Lights::is_sampled(int light) const { return table_->choice.probability(static_cast<size_t>(light)) > 0; }

std::optional<Lights::Choice> Lights::choose_bounded(double u) const {
  if (!(table_->bounded_choice.total() > 0)) return std::nullopt;
  const int light = static_cast<int>(table_->bounded_choice.sample(u).index);
  return Choice{light, bounded_pmf(light)};
}

float Lights::bounded_pmf(int light) const { return static_cast<float>(table_->bounded_choice.probability(static_cast<size_t>(light))); }

DVec3 Lights::position(int light) const { return table_->position[static_cast<size_t>(light)].value_or(DVec3(0)); }

std::optional<LightSample> Lights::sample(int light, DVec3 ref, Vec2 u, double u_primitive, ChooseBy by, Pieces pieces) const {
  const Light& model = table_->lights[static_cast<size_t>(light)];
  if (const auto* area = std::get_if<AreaLight>(&model)) return area->sample(ref, u, u_primitive, pieces);
  auto sample = std::visit(Overloaded{[&](const auto& l) { return l.sample(ref, u, u_primitive); },
                                      [](const AreaLight&) { return std::optional<LightSample>(); }},
                           model);
  if (sample && table_->infinite.size() > 1 && std::holds_alternative<InfiniteLight>(model)) {
    sample->radiance = environment(sample->wi);
    sample->pdf = environment_pdf(sample->wi, ref, by) / pmf(light, ref, by);
  }
  return sample;
}

int Lights::light_of_shape(int shape) const {
  return table_->light_of_shape.empty() ? kNone : table_->light_of_shape[static_cast<size_t>(shape)];
}

Rgb Lights::emitted(int light, const EmitterHit& hit, Vec3 wo) const {
  return std::get<AreaLight>(table_->lights[static_cast<size_t>(light)]).emitted(hit, wo);
}

float Lights::pdf(int light, DVec3 ref, const EmitterHit& hit, DVec3 wi, Pieces pieces) const {
  return std::get<AreaLight>(table_->lights[static_cast<size_t>(light)]).pdf(ref, hit, wi, pieces);
}

Rgb Lights::environment(Vec3 direction) const {
  Rgb sum(0);
  for (int i : table_->infinite) sum += std::get<InfiniteLight>(table_->lights[static_cast<size_t>(i)]).radiance(direction);
  return sum;
}

float Lights::environment_pdf(Vec3 direction, DVec3 ref, ChooseBy by) const {
  float sum = 0;
  for (int i : table_->infinite) {
    const float pdf = std::get<InfiniteLight>(table_->lights[static_cast<size_t>(i)]).pdf(direction);
    if (pdf > 0) sum += pmf(i, ref, by) * pdf;
  }
  return sum;
}

bool Lights::has_environment() const { return !table_->infinite.empty(); }

Rgb Lights::power(int light) const { return table_->power[static_cast<size_t>(light)]; }

const SourceLocation& Lights::where(int light) const { return table_->where[static_cast<size_t>(light)]; }

std::vector<std::string> Lights::notes() const {
  std::vector<std::string> notes;
  for (const Light& light : table_->lights) {
    const Image* image = nullptr;
    if (const auto* infinite = std::get_if<InfiniteLight>(&light)) image = &infinite->image();
    if (const auto* area = std::get_if<AreaLight>(&light)) image = &area->image();
    const std::string note = image != nullptr ? image->note_on_negatives() : "";
    if (!note.empty() && std::find(notes.begin(), notes.end(), note) == notes.end()) notes.push_back(note);
  }
  return notes;
}

}  // namespace woodcock
