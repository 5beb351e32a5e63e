// Surfaces that coincide: boundaries on boundaries, lamps and glass on boundaries, shared faces, edges and vertices. Media absorb only
// wherever a ray's radiance is then known for that very ray.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "renderer/core/frame.h"
#include "renderer/core/transform.h"
#include "renderer/core/warp.h"
#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

/// How a box is cut: each face into two triangles along one diagonal or the other, into many, or not at all.
enum class Cut { kDiagonal, kOtherDiagonal, kGrid, kPatches };
constexpr std::array kCuts{Cut::kDiagonal, Cut::kOtherDiagonal, Cut::kGrid, Cut::kPatches};

struct Box {
  DVec3 lower, upper;
  std::string inside, outside;
  Cut cut = Cut::kDiagonal;
  bool contains(DVec3 p) const { return glm::all(glm::greaterThan(p, lower)) && glm::all(glm::lessThan(p, upper)); }
};

/// Vertices and faces (normals outwards) of boxes in one shape, turned by `r` before they are written down.
std::string box_shape(const std::vector<Box>& boxes, const glm::dmat3& r) {
  std::string points, indices;
  int next = 0;
  const Cut cut = boxes[0].cut;
  for (const Box& box : boxes) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool upper : {false, true}) {
        const int u = (axis + 1) % 3, v = (axis + 2) % 3, n = cut == Cut::kGrid ? 5 : 1;
        const auto vertex = [&](int i, int j) {
          DVec3 p = box.lower;
          p[axis] = upper ? box.upper[axis] : box.lower[axis];
          // Unequal cells, so that no vertex but the corners is shared with another cut.
          p[u] = i == n ? box.upper[u] : glm::mix(box.lower[u], box.upper[u], std::pow(i / static_cast<double>(n), 1.3));
          p[v] = j == n ? box.upper[v] : glm::mix(box.lower[v], box.upper[v], std::pow(j / static_cast<double>(n), 1.3));
          p = r * p;
          points += fmt::format(" {:.17g} {:.17g} {:.17g}", p.x, p.y, p.z);
          return next++;
        };
        for (int i = 0; i < n; ++i) {
          for (int j = 0; j < n; ++j) {
            const int a = vertex(i, j), b = vertex(i + 1, j), c = vertex(i, j + 1), d = vertex(i + 1, j + 1);
            if (cut == Cut::kPatches) {
              indices += upper ? fmt::format(" {} {} {} {}", a, b, c, d) : fmt::format(" {} {} {} {}", a, c, b, d);
            } else {
              std::array<int, 6> t = cut == Cut::kOtherDiagonal ? std::array{a, b, c, b, d, c} : std::array{a, b, d, a, d, c};
              if (!upper) std::swap(t[1], t[2]), std::swap(t[4], t[5]);
              for (const int k : t) indices += fmt::format(" {}", k);
            }
          }
        }
      }
    }
  }
  return fmt::format("Shape \"{}\" \"point3 P\" [{} ] \"integer indices\" [{} ]\n", cut == Cut::kPatches ? "bilinearmesh" : "trianglemesh",
                     points, indices);
}
std::string box_shape(const Box& box, const glm::dmat3& r) { return box_shape(std::vector<Box>{box}, r); }

/// A rotation without a preferred axis, about which rounding differs from vertex to vertex.
glm::dmat3 tilted() {
  const Frame f = Frame::from_normal(glm::normalize(Vec3(0.3f, -0.5f, 0.81f)));
  const DVec3 n = glm::normalize(DVec3(f.n)), s = glm::normalize(DVec3(f.s) - n * glm::dot(n, DVec3(f.s)));
  return {s, glm::cross(n, s), n};
}

const std::map<std::string, double> kSigma{{"", 0}, {"m", 0.7}, {"n", 1.9}, {"o", 0.2}};

std::string media() {
  std::string text;
  for (const auto& [name, sigma] : kSigma)
    if (!name.empty()) text += homogeneous(name, Rgb(static_cast<float>(sigma)), Rgb(0));
  return text;
}

/// Optical depth along the ray: the last box of the list that holds a point says which medium is there.
double optical_depth(const std::vector<Box>& boxes, DVec3 o, DVec3 d) {
  std::vector<double> cuts{0};
  for (const Box& b : boxes)
    for (int axis = 0; axis < 3; ++axis)
      for (const double plane : {b.lower[axis], b.upper[axis]})
        if (const double t = (plane - o[axis]) / d[axis]; std::isfinite(t) && t > 0) cuts.push_back(t);
  std::sort(cuts.begin(), cuts.end());
  double depth = 0;
  for (size_t i = 1; i < cuts.size(); ++i) {
    const DVec3 p = o + 0.5 * (cuts[i - 1] + cuts[i]) * d;
    for (auto b = boxes.rbegin(); b != boxes.rend(); ++b) {
      if (!b->contains(p)) continue;
      depth += kSigma.at(b->inside) * (cuts[i] - cuts[i - 1]);
      break;
    }
  }
  return depth;
}

/// A ray given in world space, and as the floats of render space have it.
struct TestRay {
  Ray ray;
  DVec3 o, d;  ///< of `ray`, in world space; d is a unit vector
};
TestRay test_ray(const CompiledScene& scene, DVec3 o, DVec3 towards) {
  const RenderSpace& space = scene.world->space;
  const Ray ray{Vec3(transform_point(space.render_from_world, o)), Vec3(glm::normalize(towards - o))};
  return {ray, transform_point(space.world_from_render, DVec3(ray.o)), glm::normalize(DVec3(ray.d))};
}
float radiance(const CompiledScene& scene, const TestRay& ray, PathCounters& counters) {
  return trace_path(*scene.world, {*scene.world, scene.settings}, ray.ray, path_key(1, 0, 0, 0), counters).radiance.r;
}

/// What the origins that surfaces move by a few units in the last place change in a radiance, at a grazing angle.
constexpr double kOffset = 1e-4;

/// Rays from all sides towards points of the boxes, half of them to vertices, edges and centres of faces: each has to
/// come out with the transmittance of its own way.
void expect_transmittance(const CompiledScene& scene, const std::vector<Box>& boxes, const glm::dmat3& r, const std::string& what) {
  Stream random(1);
  PathCounters counters;
  int wrong = 0, slipped = 0;
  for (int i = 0; i < 1500; ++i) {
    const Box& box = boxes[random.next_u32() % boxes.size()];
    DVec3 f(random.uniform_double(), random.uniform_double(), random.uniform_double());
    const bool aimed = i % 2 == 0;
    if (aimed) {
      for (int axis = 0; axis < 3; ++axis) f[axis] = std::round(2 * f[axis]) / 2;
    }
    const DVec3 target = glm::mix(box.lower, box.upper, f);
    // Outside of all media, as the camera is.
    DVec3 o = 5.0 * DVec3(square_to_sphere(random.uniform2()));
    const bool in_plane = i % 8 == 0;
    if (in_plane) o = target + DVec3(i % 3 == 0, i % 3 == 1, i % 3 == 2) * (i % 16 == 0 ? 5.0 : -5.0);
    const TestRay ray = test_ray(scene, r * o, r * target);
    const auto found = static_cast<double>(radiance(scene, ray, counters));
    const DVec3 ro = glm::transpose(r) * ray.o, rd = glm::transpose(r) * ray.d;
    const double expected = std::exp(-optical_depth(boxes, ro, rd));
    // Along an edge or in the plane of a face a rounding decides where the ray goes: then it is what lies around.
    double least = expected, most = expected;
    for (int k = 0; k < 32; ++k) {
      const double there = std::exp(-optical_depth(boxes, ro + 2e-6 * DVec3(square_to_sphere(random.uniform2())), rd));
      least = std::min(least, there);
      most = std::max(most, there);
    }
    // In the plane of faces or along an edge it may be any of the media there, but none without an end.
    if (in_plane) least = std::exp(-1.9 * 3.5), most = 1;
    const bool right = found > least - kOffset && found < most + kOffset;
    if (right) continue;
    // The float arithmetic of Embree may take a ray through a vertex past all of its faces: of the 3000 aimed rays of four seeds four met
    // that in some of the cuts.
    if (aimed && ++slipped == 1) continue;
    if (++wrong <= 3)
      ADD_FAILURE() << what
                    << fmt::format(": ray {} to ({}, {}, {}) from ({}, {}, {}) is {}, expected {}", i, target.x, target.y, target.z, o.x,
                                   o.y, o.z, found, expected);
  }
  EXPECT_EQ(wrong, 0) << what;
  EXPECT_EQ(counters.truncated, 0u) << what;
}

std::string head() { return perspective({0, 0, 5}, {0, 0, 0}, 30, 5) + "WorldBegin\n" + environment(1) + media(); }

/// The boxes as boundaries of their own, in both orders of definition, upright and tilted, in all cuts.
void expect_transmittance(std::vector<Box> boxes, const std::string& what) {
  for (const bool tilt : {false, true}) {
    const glm::dmat3 r = tilt ? tilted() : glm::dmat3(1);
    for (size_t first = 0; first < kCuts.size(); ++first) {
      for (const bool reverse : {false, true}) {
        // Each box has another cut than the one before it, or all have the same.
        for (const size_t step : {size_t{0}, size_t{1}}) {
          std::vector<std::string> shapes;
          for (size_t i = 0; i < boxes.size(); ++i) {
            boxes[i].cut = kCuts[(first + i * step) % kCuts.size()];
            shapes.push_back(boundary(boxes[i].inside, boxes[i].outside, box_shape(boxes[i], r)));
          }
          if (reverse) std::reverse(shapes.begin(), shapes.end());
          std::string text = head();
          for (const auto& s : shapes) text += s;
          expect_transmittance(
              compile(text), boxes, r,
              fmt::format("{}, cut {} step {}{}{}", what, first, step, tilt ? ", tilted" : "", reverse ? ", reversed" : ""));
        }
      }
    }
  }
}

TEST(HardCases, N62_boundaries_of_equal_boxes_are_both_crossed) {
  expect_transmittance({{DVec3(-1), DVec3(1), "m", ""}, {DVec3(-1), DVec3(1), "n", "m"}}, "nested equal boxes");
  expect_transmittance({{DVec3(-1), DVec3(1), "m", ""}, {DVec3(-1), DVec3(1), "m", ""}}, "the same box twice");
}

TEST(HardCases, N62_boxes_side_by_side_share_a_face) {
  expect_transmittance({{{-1, -1, -1}, {0.1, 1, 1}, "m", ""}, {{0.1, -1, -1}, {1, 1, 1}, "n", ""}}, "equal faces");
  expect_transmittance({{{-1, -1, -1}, {0.1, 1, 1}, "m", ""}, {{0.1, -0.6, -0.3}, {1, 0.4, 0.7}, "n", ""}}, "a smaller face");
  expect_transmittance({{{-1, -1, -1}, {0.1, 1, 1}, "m", ""}, {{0.1, -1, -1}, {1, 1, 1}, "m", ""}}, "one medium");
}

TEST(HardCases, N62_nested_boxes_share_faces) {
  expect_transmittance({{DVec3(-1), DVec3(1), "m", ""}, {{-0.5, -0.6, -0.4}, {0.7, 0.5, 1}, "n", "m"}}, "one face");
  expect_transmittance({{DVec3(-1), DVec3(1), "m", ""}, {{0, 0.1, -0.3}, {1, 1, 1}, "n", "m"}}, "three faces");
  expect_transmittance({{DVec3(-1), DVec3(1), "m", ""}, {{-1, -1, 0.2}, {1, 1, 1}, "n", "m"}, {{-1, -1, 0.2}, {0.3, 1, 1}, "o", "n"}},
                       "three deep");
}

TEST(HardCases, N28_eight_boxes_meet_in_a_vertex) {
  std::vector<Box> boxes;
  for (int i = 0; i < 8; ++i) {
    const DVec3 corner((i & 1) != 0 ? 1 : -0.9, (i & 2) != 0 ? 0.8 : -1, (i & 4) != 0 ? 1 : -0.7);
    boxes.push_back({glm::min(corner, DVec3(0)), glm::max(corner, DVec3(0)), i % 3 == 0 ? "m" : i % 3 == 1 ? "n" : "o", ""});
  }
  expect_transmittance(boxes, "eight boxes");
}

TEST(HardCases, N62_boxes_of_one_shape_share_a_face) {
  for (const Cut cut : kCuts) {
    for (const bool tilt : {false, true}) {
      const glm::dmat3 r = tilt ? tilted() : glm::dmat3(1);
      const std::vector<Box> boxes{{{-1, -1, -1}, {0.1, 1, 1}, "n", "", cut}, {{0.1, -1, -1}, {1, 1, 1}, "n", "", cut}};
      expect_transmittance(compile(head() + boundary("n", "", box_shape(boxes, r))), boxes, r, "one shape");
    }
  }
}

TEST(HardCases, N62_instances_share_faces) {
  for (const Cut cut : kCuts) {
    const std::vector<Box> boxes{{{-1, -1, -1}, {0.1, 1, 1}, "m", "", cut}, {{0.1, -1, -1}, {1, 1, 1}, "n", "", cut}};
    // The first is scaled and moved from a unit box, the second mirrored.
    const Box unit{DVec3(0), DVec3(1), "", "", cut};
    const std::string text = head() + "ObjectBegin \"a\"\n" + boundary("m", "", box_shape(unit, glm::dmat3(1))) + "ObjectEnd\n" +
                             "ObjectBegin \"b\"\n" + boundary("n", "", box_shape(unit, glm::dmat3(1))) + "ObjectEnd\n" +
                             "AttributeBegin\nTranslate -1 -1 -1\nScale 1.1 2 2\nObjectInstance \"a\"\nAttributeEnd\n" +
                             "AttributeBegin\nTranslate 1 -1 -1\nScale -.9 2 2\nObjectInstance \"b\"\nAttributeEnd\n";
    expect_transmittance(compile(text), boxes, glm::dmat3(1), "instances");
  }
}

TEST(HardCases, N62_spheres_of_equal_radius_are_both_crossed) {
  const std::string outer = boundary("m", "", sphere(1)),
                    inner = boundary("n", "m", "Rotate 40 1 2 3\nShape \"sphere\" \"float radius\" 1\n");
  for (const bool reverse : {false, true}) {
    const CompiledScene scene = compile(head() + (reverse ? inner + outer : outer + inner));
    Stream random(2);
    PathCounters counters;
    for (int i = 0; i < 5000; ++i) {
      const TestRay ray = test_ray(scene, 5.0 * DVec3(square_to_sphere(random.uniform2())), DVec3(square_to_sphere(random.uniform2())));
      const double b2 = glm::dot(ray.o, ray.o) - std::pow(glm::dot(ray.o, ray.d), 2), chord = b2 < 1 ? 2 * std::sqrt(1 - b2) : 0;
      EXPECT_NEAR(radiance(scene, ray, counters), std::exp(-1.9 * chord), 1e-5 + 1.5e-5 / std::max(chord, 1e-3)) << i;
    }
    EXPECT_EQ(counters.truncated, 0u);
  }
}

// A lamp behind a box of fog, its light coming through the box's far side: in front of it by `gap`, behind it, or on it.
TEST(HardCases, N61_a_lamp_on_an_interface_is_seen_through_the_medium) {
  const double sigma = kSigma.at("m");
  for (const bool tilt : {false, true}) {
    const glm::dmat3 r = tilt ? tilted() : glm::dmat3(1);
    for (const double gap : {0.0, 1e-9, -1e-9, 1e-7, -1e-7, 1e-6, -1e-6, 1e-5, -1e-5, 1e-4, -1e-4}) {
      for (const Cut cut : kCuts) {
        for (const bool lamp_first : {false, true}) {
          const Box fog{DVec3(-1, -1, -0.3), DVec3(1, 1, 0.7), "m", "", cut};
          std::string corners;
          for (const DVec2 c : {DVec2(-0.9, -0.8), DVec2(0.8, -0.8), DVec2(-0.9, 0.9), DVec2(0.8, 0.9)}) {
            const DVec3 p = r * DVec3(c, -0.3 - gap);
            corners += fmt::format(" {:.17g} {:.17g} {:.17g}", p.x, p.y, p.z);
          }
          const std::string lamp =
              "AttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nAreaLightSource \"diffuse\" \"rgb L\" [ 3 3 3 ]\n"
              "Shape \"bilinearmesh\" \"point3 P\" [" +
              corners + " ]\nAttributeEnd\n";
          const std::string wall = boundary("m", "", box_shape(fog, r));
          const CompiledScene scene = compile(head() + (lamp_first ? lamp + wall : wall + lamp));
          Stream random(3);
          PathCounters counters;
          int compared = 0;
          for (int i = 0; i < 200; ++i) {
            const DVec3 target(1.6 * random.uniform_double() - 0.8, 1.5 * random.uniform_double() - 0.7, -0.3);
            const DVec3 o(2 * random.uniform_double() - 1, 2 * random.uniform_double() - 1, 4);
            const DVec3 d = glm::normalize(target - o);
            const DVec3 top = o + d * ((0.7 - o.z) / d.z);
            if (std::abs(top.x) > 0.99 || std::abs(top.y) > 0.99) continue;
            const double way = 1 / -d.z;
            const std::string what = fmt::format("gap {} cut {} ray {}", gap, static_cast<int>(cut), i) + (tilt ? " tilted" : "") +
                                     (lamp_first ? " lamp first" : "");
            ASSERT_NEAR(radiance(scene, test_ray(scene, r * o, r * target), counters), 3 * std::exp(-sigma * way), 3e-4) << what;
            // Its back is black.
            ASSERT_EQ(radiance(scene, test_ray(scene, r * (target + 4.0 * d), r * target), counters), 0) << what;
            ++compared;
          }
          EXPECT_GT(compared, 100);
        }
      }
    }
  }
}

// The walls of a room shine with radiance one, the room is full of fog that only scatters, and the fog's boundary lies on
// the walls: every ray carries one, found by phase function and by light sampling alike.
TEST(HardCases, N61_lamps_on_a_boundary_are_a_furnace) {
  const std::string fog = homogeneous("fog", Rgb(0), Rgb(1.5f), 0.3);
  for (const double gap : {0.0, 1e-9, -1e-7, 1e-7, 1e-6, -1e-6, 1e-4}) {
    for (const bool tilt : {false, true}) {
      const glm::dmat3 r = tilt ? tilted() : glm::dmat3(1);
      const Box walls{DVec3(-1 - gap), DVec3(1 + gap), "", "", Cut::kOtherDiagonal}, inside{DVec3(-1), DVec3(1), "fog", "", Cut::kGrid};
      const std::string lamps =
          "AttributeBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nReverseOrientation\nAreaLightSource \"diffuse\" \"rgb L\" [ "
          "1 1 1 ]\n" +
          box_shape(walls, r) + "AttributeEnd\n";
      const std::string text = "MediumInterface \"\" \"fog\"\n";
      const std::string camera = fog + text + perspective({0.1, 0.2, 0.3}, {1, 0.4, 0.1}, 70, 10000) + "WorldBegin\n";
      for (const bool reverse : {false, true}) {
        const std::string wall = boundary("fog", "", box_shape(inside, r));
        const Estimate e = estimate(camera + (reverse ? wall + lamps : lamps + wall), 4000, 3);
        expect_value(e, 1, 0.02, fmt::format("gap {}{}{}", gap, tilt ? " tilted" : "", reverse ? " reversed" : ""));
      }
    }
  }
}

// A film of optical depth one is no surface, however far away it is seen from. Next to the origin of render space, where floats
// are dense, a millionth of the distance survives.
TEST(HardCases, N61_a_thin_film_keeps_its_optical_depth) {
  for (const double thickness : {1e-2, 1e-4, 1e-6}) {
    const std::string film = box_shape({{-50, -50, -thickness}, {50, 50, 0}, "", ""}, glm::dmat3(1));
    const CompiledScene scene = compile(perspective({3, 4, 20}, {3, 4, 0}, 30, 5) + "WorldBegin\n" + environment(1) +
                                        homogeneous("film", Rgb(static_cast<float>(1 / thickness)), Rgb(0)) + boundary("film", "", film));
    PathCounters counters;
    for (const DVec2 at : {DVec2(3, 4), DVec2(7, -11), DVec2(-20, 31)})
      EXPECT_NEAR(radiance(scene, test_ray(scene, {at.x, at.y, 90}, {at.x, at.y, 0}), counters), std::exp(-1), 2e-3) << thickness;
  }
}

// Scatterings within a few units in the last place of a tilted face; a path that overlooks the face never comes back.
TEST(HardCases, N12_dense_boxes_with_a_common_face_are_a_furnace) {
  const std::string dense = homogeneous("fog", Rgb(0), Rgb(3000)) + homogeneous("mist", Rgb(0), Rgb(300), 0.5);
  const glm::dmat3 r = tilted();
  for (const bool reverse : {false, true}) {
    const std::string a = boundary("fog", "", box_shape({{-1, -1, -1}, {0.1, 1, 1}, "", "", Cut::kDiagonal}, r)),
                      b = boundary("mist", "", box_shape({{0.1, -1, -1}, {1, 1, 1}, "", "", Cut::kGrid}, r));
    const Estimate e = estimate(
        perspective({0, 0, 5}, {0, 0, 0}, 30, 1000000) + "WorldBegin\n" + environment(1) + dense + (reverse ? b + a : a + b), 700, 1);
    expect_value(e, 1, 0.03, "dense boxes");
  }
}

TEST(HardCases, N62_an_interface_on_a_glass_face_equals_glass_with_a_medium) {
  // Lit from one side, so that a medium that is lost or kept too long shows.
  const std::string start = perspective({0.5, 1, 4}, {0, 0, 0}, 35, 100) + "WorldBegin\nLightSource \"infinite\" \"rgb L\" [ .2 .2 .2 ]\n" +
                            "AttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 4 4 4 ]\n" + sphere(1, {-3, 2, -1}) +
                            "AttributeEnd\n" + homogeneous("fog", Rgb(0.3f), Rgb(1.2f), 0.2);
  const std::string glass = "Material \"dielectric\" \"float eta\" 1.3\n";
  for (const bool tilt : {false, true}) {
    const glm::dmat3 r = tilt ? tilted() : glm::dmat3(1);
    const Box box{DVec3(-1), DVec3(1), "", "", Cut::kDiagonal}, other{DVec3(-1), DVec3(1), "", "", Cut::kGrid};
    for (const auto& [outer, inner] : {std::pair{box_shape(box, r), box_shape(other, r)}, std::pair{sphere(1), sphere(1)}}) {
      const Estimate one =
          estimate(start + "AttributeBegin\n" + glass + "MediumInterface \"fog\" \"\"\n" + outer + "AttributeEnd\n", 20000, 1);
      const std::string body = "AttributeBegin\n" + glass + outer + "AttributeEnd\n", skin = boundary("fog", "", inner);
      expect_equal(estimate(start + body + skin, 20000, 2), one, 0.03, "glass first");
      expect_equal(estimate(start + skin + body, 20000, 3), one, 0.03, "interface first");
    }
  }
}

TEST(HardCases, N16_equal_glass_blocks_that_touch_are_one) {
  // From inside one block, through the face that both share, to a lamp in the other: nothing is reflected on the way.
  for (const bool tilt : {false, true}) {
    const glm::dmat3 r = tilt ? tilted() : glm::dmat3(1);
    const auto at = [&](DVec3 p) { return r * p; };
    const std::string glass = "Material \"dielectric\" \"float eta\" 1.5\n";
    const std::string a = glass + box_shape({{-1, -1, -1}, {0.1, 1, 1}, "", "", Cut::kDiagonal}, r),
                      b = glass + box_shape({{0.1, -1, -1}, {1, 1, 1}, "", "", Cut::kGrid}, r);
    const std::string lamp =
        "Material \"diffuse\" \"rgb reflectance\" [ 0 0 0 ]\nAreaLightSource \"diffuse\" \"rgb L\" [ 1 1 1 ] \"bool twosided\" true\n" +
        box_shape({{0.5, -0.9, -0.9}, {0.6, 0.9, 0.9}, "", "", Cut::kDiagonal}, r);
    for (const bool reverse : {false, true}) {
      const CompiledScene scene =
          compile(perspective(at({-0.8, 0.1, 0.2}), at({1, 0, 0}), 40, 10) + "WorldBegin\n" + (reverse ? b + a : a + b) + lamp);
      for (const Rgb& value : radiances(scene, 5000, 1)) ASSERT_EQ(value, Rgb(1));
    }
  }
}

}  // namespace
}  // namespace woodcock::testing
