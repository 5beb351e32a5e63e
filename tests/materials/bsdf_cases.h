// Every scattering model with representative parameters: tests iterate over this list.
#pragma once

#include <deque>
#include <string>
#include <vector>

#include "renderer/materials/bsdf.h"

namespace woodcock::testing {

struct BsdfCase {
  std::string name;
  Bsdf bsdf;
  bool layered = false;  ///< `eval` is stochastic, `pdf` a proxy
};

/// In closed form, with a table that lasts.
inline CoatedDiffuseBsdf in_closed_form(CoatedDiffuseBsdf b) {
  static std::deque<CoatTable> tables;
  const Coat& c = b.coat;
  b.table = &tables.emplace_back(c.boundary.eta, c.boundary.roughness, c.thickness);
  return b;
}
inline CoatedConductorBsdf by_walks(CoatedConductorBsdf b) {
  b.coat.walks = true;
  return b;
}

inline Coat coat(float eta, Ggx roughness, float thickness, Rgb albedo, float g) {
  Coat c;
  c.boundary = {eta, roughness};
  c.thickness = thickness;
  c.albedo = albedo;
  c.g = g;
  return c;
}

inline std::vector<BsdfCase> bsdf_cases() {
  const Rgb copper_eta{0.27f, 0.68f, 1.32f}, copper_k{3.6f, 2.63f, 2.29f};
  const Rgb inner_eta = copper_eta / 1.5f, inner_k = copper_k / 1.5f;
  return {
      {"diffuse", DiffuseBsdf{{0.9f, 0.5f, 0.1f}}},
      {"diffuse transmission", DiffuseTransmissionBsdf{{0.5f, 0.2f, 0.1f}, {0.1f, 0.3f, 0.4f}}},
      {"smooth conductor", ConductorBsdf{copper_eta, copper_k, {}}},
      {"rough conductor", ConductorBsdf{copper_eta, copper_k, {0.3f, 0.3f}}},
      {"very rough conductor", ConductorBsdf{copper_eta, copper_k, {1.0f, 1.0f}}},
      {"brushed conductor", ConductorBsdf{copper_eta, copper_k, {0.5f, 0.15f}}},
      {"smooth dielectric", DielectricBsdf{1.5f, {}}},
      {"index-matched rough dielectric", DielectricBsdf{1.0f, {0.3f, 0.3f}}},
      {"rough dielectric", DielectricBsdf{1.5f, {0.3f, 0.3f}}},
      {"very rough dielectric", DielectricBsdf{1.33f, {0.9f, 0.9f}}},
      {"brushed dielectric", DielectricBsdf{2.4f, {0.2f, 0.5f}}},
      {"rough bubble", DielectricBsdf{0.7f, {0.4f, 0.4f}}},
      {"thin dielectric", ThinDielectricBsdf{1.5f}},
      {"smooth coat over diffuse", CoatedDiffuseBsdf{coat(1.5f, {}, 0.01f, Rgb(0), 0), {{0.9f, 0.5f, 0.1f}}, nullptr}, true},
      {"rough coat over diffuse", CoatedDiffuseBsdf{coat(1.5f, {0.4f, 0.4f}, 0.01f, Rgb(0), 0), {{0.9f, 0.5f, 0.1f}}, nullptr}, true},
      {"rough foggy coat over diffuse", CoatedDiffuseBsdf{coat(1.33f, {0.3f, 0.5f}, 0.7f, {0.9f, 0.6f, 0}, 0.4f), {Rgb(0.5f)}, nullptr},
       true},
      {"smooth foggy coat over diffuse", CoatedDiffuseBsdf{coat(1.5f, {}, 0.5f, Rgb(0.8f), -0.3f), {Rgb(0.7f)}, nullptr}, true},
      {"smooth coat over diffuse, closed form", in_closed_form({coat(1.5f, {}, 0.01f, Rgb(0), 0), {{0.9f, 0.5f, 0.1f}}, nullptr})},
      {"smooth coat of low index over diffuse, closed form",
       in_closed_form({coat(0.8f, {}, 0.4f, Rgb(0), 0), {{0.9f, 0.5f, 0.1f}}, nullptr})},
      {"index-matched coat over diffuse, closed form", in_closed_form({coat(1, {}, 0.2f, Rgb(0), 0), {{0.9f, 0.5f, 0.1f}}, nullptr})},
      {"rough coat over diffuse, closed form", in_closed_form({coat(1.5f, {0.4f, 0.4f}, 0.01f, Rgb(0), 0), {{0.9f, 0.5f, 0.1f}}, nullptr})},
      {"sea, closed form", in_closed_form({coat(1.33f, {0.35f, 0.35f}, 0.01f, Rgb(0), 0), {{0.012f, 0.045f, 0.07f}}, nullptr})},
      {"nearly smooth thick coat over diffuse, closed form",
       in_closed_form({coat(1.8f, {0.05f, 0.05f}, 0.3f, Rgb(0), 0), {Rgb(0.95f)}, nullptr})},
      {"smooth coat over smooth conductor", CoatedConductorBsdf{coat(1.5f, {}, 0.01f, Rgb(0), 0), {inner_eta, inner_k, {}}}, true},
      {"smooth coat over smooth conductor, by walks", by_walks({coat(1.5f, {}, 0.01f, Rgb(0), 0), {inner_eta, inner_k, {}}}), true},
      {"smooth coat over rough conductor", CoatedConductorBsdf{coat(1.5f, {}, 0.01f, Rgb(0), 0), {inner_eta, inner_k, {0.3f, 0.3f}}}, true},
      {"rough coat over smooth conductor", CoatedConductorBsdf{coat(1.5f, {0.3f, 0.3f}, 0.01f, Rgb(0), 0), {inner_eta, inner_k, {}}}, true},
      {"rough foggy coat over rough conductor",
       CoatedConductorBsdf{coat(1.5f, {0.2f, 0.4f}, 0.4f, Rgb(0.9f), 0.6f), {inner_eta, inner_k, {0.4f, 0.4f}}}, true},
      {"smooth foggy coat over smooth conductor", CoatedConductorBsdf{coat(1.5f, {}, 0.3f, Rgb(0.9f), 0.3f), {inner_eta, inner_k, {}}},
       true},
  };
}

/// Directions from steep to grazing, from above and below.
inline std::vector<Vec3> outgoing_directions() {
  std::vector<Vec3> result;
  for (const Vec3 w : {Vec3(0, 0, 1), Vec3(0.3f, -0.2f, 0.9f), Vec3(-0.8f, 0.5f, 0.4f), Vec3(0.2f, 1.0f, 0.05f)}) {
    result.push_back(glm::normalize(w));
    result.push_back(-glm::normalize(w));
  }
  return result;
}

}  // namespace woodcock::testing
