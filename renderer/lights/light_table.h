// The list of light models, and what `Lights` holds.
//
// A model is a struct with `sample(Vec3 ref, Vec2 u, double u_primitive) -> std::optional<LightSample>` and
// `power() -> Rgb`; models that rays can meet have more, which `Lights` reaches by name. To add one: a file pair,
// a line in `Light`, a line in the constructor of `Lights`.
#pragma once

#include <variant>

#include "renderer/core/distribution.h"
#include "renderer/lights/area_light.h"
#include "renderer/lights/delta_lights.h"
#include "renderer/lights/infinite_light.h"
#include "renderer/lights/light.h"
#include "renderer/lights/light_selection.h"

namespace woodcock {

using Light = std::variant<PointLight, SpotLight, DistantLight, InfiniteLight, AreaLight>;

struct LightTable {
  std::vector<Light> lights;
  std::vector<SourceLocation> where;
  std::vector<Rgb> power;
  LightSelection selection;                     // by what arrives
  DiscreteDistribution choice, bounded_choice;  // by power
  std::vector<std::optional<DVec3>> position;   // of bounded lights
  std::vector<int> light_of_shape;              // empty or one per shape
  std::vector<int> infinite;                    // indices of the infinite lights
};

}  // namespace woodcock
