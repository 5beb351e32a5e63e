// A light sample sees what a ray to it meets first, whatever the shape of the light and however small it is (N73).
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "renderer/core/warp.h"
#include "tests/hard_cases/scene_pieces.h"

namespace woodcock::testing {
namespace {

struct LightShape {
  std::string name, text;
  bool encloses = false;  ///< its inside cannot be seen from outside
};

/// The corners of the cube from −0.8 to 0.8, x fastest.
std::string cube_points() {
  std::string points;
  for (int i = 0; i < 8; ++i) points += fmt::format(" {} {} {}", (i & 1) != 0 ? .8 : -.8, (i & 2) != 0 ? .8 : -.8, (i & 4) != 0 ? .8 : -.8);
  return points;
}

/// Shapes of a size of about one around the origin.
std::vector<LightShape> light_shapes() {
  return {
      {"sphere", "Shape \"sphere\" \"float radius\" 1\n", true},
      {"ellipsoid", "Scale 1 .4 1.5\nShape \"sphere\" \"float radius\" 1\n", true},
      {"part of a sphere", "Shape \"sphere\" \"float radius\" 1 \"float zmin\" -.5 \"float zmax\" .8 \"float phimax\" 250\n"},
      {"bowl", "Shape \"sphere\" \"float radius\" 1 \"float zmax\" 0\n"},
      {"tube", "Rotate 90 0 1 0\nShape \"cylinder\" \"float radius\" .4 \"float zmin\" -1 \"float zmax\" 1\n"},
      {"part of a tube",
       "Rotate 90 1 0 0\nShape \"cylinder\" \"float radius\" .6 \"float zmin\" -1 \"float zmax\" 1 \"float phimax\" 200\n"},
      {"disk", "Rotate 20 1 0 0\nShape \"disk\" \"float radius\" 1\n"},
      {"triangles", "Shape \"trianglemesh\" \"point3 P\" [ -1 -1 0  1 -1 .3  0 1 .5  -1 1 -.8 ] \"integer indices\" [ 0 1 2 0 2 3 ]\n"},
      {"saddle", "Shape \"bilinearmesh\" \"point3 P\" [ -1 -1 1  1 -1 -1  -1 1 -1  1 1 1 ]\n"},
      {"folded saddle", "Shape \"bilinearmesh\" \"point3 P\" [ -1 -1 1.6  1 -1 -1  -1 1 -1  .3 .2 1.6 ]\n"},
      {"steep saddle", "Rotate 70 1 0 0\nShape \"bilinearmesh\" \"point3 P\" [ -1 -1 1  1 -1 -1  -1 1 -1  1 1 1 ]\n"},
      {"flat quadrilateral", "Shape \"bilinearmesh\" \"point3 P\" [ -1 -1 0  1 -1 0  -.4 1 0  .7 .8 0 ]\n"},
      {"cube of patches",
       fmt::format("Rotate 33 1 2 3\nShape \"bilinearmesh\" \"point3 P\" [{} ] \"integer indices\" [ 0 2 1 3  4 5 6 7  0 1 4 5  2 6 3 7  "
                   "0 4 2 6  1 3 5 7 ]\n",
                   cube_points()),
       true},
      {"cube of triangles",
       fmt::format("Rotate 33 1 2 3\nShape \"trianglemesh\" \"point3 P\" [{} ] \"integer indices\" [ 0 2 1 1 2 3  4 5 6 6 5 7  0 1 4 4 1 "
                   "5  2 6 3 3 6 7  0 4 2 2 4 6  1 3 5 5 3 7 ]\n",
                   cube_points()),
       true},
      {"folded flat patch", "Shape \"bilinearmesh\" \"point3 P\" [ -1 -1 0  1 -1 0  -1 1 0  -.6 -.6 0 ]\n"},
  };
}

/// A floor at depth 1 that a light of this size 30 units above it lights; seen from between them. `strength` in power per size².
std::string floor_scene(const LightShape& light, double size, bool two_sided, bool reversed, const std::string& more = "") {
  return perspective({0, 0, 0.5}, {0, 0.001, -10}, 40, 1) +
         "WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .5 .5 .5 ]\nShape \"bilinearmesh\" \"point3 P\" [ -5 -5 0  5 -5 0  -5 5 0 "
         " 5 5 "
         "0 ]\n" +
         fmt::format(
             "AttributeBegin\n{}Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nAreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] "
             "\"float scale\" {:.9g} \"bool twosided\" {}\nTranslate 0 0 30\nScale {:.9g} {:.9g} {:.9g}\n{}{}AttributeEnd\n",
             more, 1000 / (size * size), two_sided ? "true" : "false", size, size, size, reversed ? "ReverseOrientation\n" : "",
             light.text);
}

constexpr double kSizes[] = {3e-2, 1e-3, 1e-5};

TEST(HardCases, N73_a_light_shrunk_with_its_power_kept_lights_as_before) {
  for (const LightShape& light : light_shapes())
    for (const bool two_sided : {false, true})
      for (const bool reversed : {false, true}) {
        const Estimate large = estimate(floor_scene(light, kSizes[0], two_sided, reversed), 20000, 1);
        for (const double size : {kSizes[1], kSizes[2]}) {
          const Estimate small = estimate(floor_scene(light, size, two_sided, reversed), 20000, 2);
          // By 1e-5 of the distance: the floor sees a light of 3e-2 from angles that differ by 1e-3.
          EXPECT_NEAR(small.mean[1], large.mean[1], 0.01 * large.mean[1] + kStandardErrors * std::hypot(small.error[1], large.error[1]))
              << light.name << (two_sided ? ", two-sided" : "") << (reversed ? ", reversed" : "") << ", size " << size;
        }
      }
}

TEST(HardCases, N73_the_hidden_inside_of_a_light_adds_nothing_and_a_light_that_shines_inwards_lights_nothing) {
  for (const LightShape& light : light_shapes()) {
    if (!light.encloses) continue;
    for (const double size : kSizes) {
      const Estimate outside = estimate(floor_scene(light, size, false, false), 20000, 1),
                     both = estimate(floor_scene(light, size, true, false), 20000, 2);
      expect_equal(outside, both, 0.03, light.name);
      // Embree's rays pass by the edges of the largest by up to 2⁻²³ of the distance, a ten-thousandth of its width.
      const double inwards = estimate(floor_scene(light, size, false, true), 20000, 3).mean[1];
      EXPECT_LE(inwards, size == kSizes[0] && light.name.starts_with("cube") ? 1e-3 * outside.mean[1] : 0) << light.name << ' ' << size;
    }
  }
}

TEST(HardCases, N73_light_sampling_and_chance_see_the_same_of_a_light_close_by) {
  for (const LightShape& light : light_shapes())
    for (const bool two_sided : {false, true}) {
      // The light hangs over the floor, as large as its distance.
      const std::string text = perspective({0, 0, 0.5}, {0, 0.001, -10}, 60, 1) +
                               "WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .5 .5 .5 ]\nShape \"bilinearmesh\" \"point3 P\" [ "
                               "-5 -5 0  5 -5 0  -5 5 0  5 5 "
                               "0 ]\nAttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\n" +
                               fmt::format(
                                   "AreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" {}\nTranslate .3 .2 2.2\nRotate 180 "
                                   "1 0 0\n{}AttributeEnd\n",
                                   two_sided ? "true" : "false", light.text);
      CompiledScene by_chance = compile(text), by_light = compile(text);
      by_chance.settings.features.take_out(Feature::kLightSampling);
      by_light.settings.features.take_out(Feature::kMis);
      const Estimate chance = estimate(by_chance, 100000, 1);
      if (chance.mean[1] == 0) {
        EXPECT_EQ(estimate(by_light, 5000, 2).mean[1], 0) << light.name;
        continue;
      }
      expect_equal(estimate(by_light, 100000, 2), chance, 0.1, light.name + (two_sided ? ", two-sided" : ""));
      expect_equal(estimate(text, 60000, 3), chance, 0.1, light.name + (two_sided ? ", two-sided" : ""));
    }
}

TEST(HardCases, N73_a_light_sample_is_seen_where_a_ray_to_it_meets_it_first) {
  // The relation itself: of each sample, from points all around and inside.
  Stream random(73);
  for (const LightShape& light : light_shapes()) {
    const CompiledScene scene = compile(floor_scene(light, 1, true, false));
    const World& world = *scene.world;
    int seen = 0, hidden = 0;
    for (int i = 0; i < 4000; ++i) {
      const DVec3 around = DVec3(0, 0, 30) + static_cast<double>(0.1f + 3 * random.uniform()) * DVec3(square_to_sphere(random.uniform2()));
      const DVec3 ref = world.space.scale * (around - world.space.center);
      const auto s = world.lights.sample(0, ref, random.uniform2(), random.uniform_double());
      if (!s || std::abs(glm::dot(s->wi, s->n)) < 1e-3f) continue;
      const DVec3 to = s->p - ref;
      const double distance = glm::length(to);
      const Ray ray{ref, to / distance};
      const bool visible = !world.geometry.occluded(ray, distance, s->target);
      const auto first = world.geometry.intersect(ray, kInf);
      if (!first) continue;  // beside an edge by a rounding
      const bool is_first = first->shape == s->target.shape && first->t > distance * (1 - 1e-6);
      const bool near_tie = first->shape == s->target.shape && std::abs(first->t - distance) < 1e-6 * distance;
      if (light.name != "folded flat patch" || !near_tie) {
        ASSERT_EQ(visible, is_first) << light.name << ' ' << i << ": met at " << first->t << " of " << distance;
      }
      ++(visible ? seen : hidden);
    }
    EXPECT_GT(seen, 500) << light.name;
    if (light.name == "tube" || light.name == "bowl") {
      EXPECT_GT(hidden, 100) << light.name;
    }
  }
}

}  // namespace
}  // namespace woodcock::testing
