// Surfaces at the limits: grazing views, indices of one, slivers, large and far shapes; and how rays meet them.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "renderer/core/warp.h"
#include "renderer/geometry/geometry.h"
#include "renderer/materials/fresnel.h"
#include "tests/geometry/shapes.h"
#include "tests/materials/bsdf_cases.h"

namespace woodcock::testing {
namespace {

/// The textbook form, in 64-bit mantissas.
long double reference_dielectric(long double c, long double eta) {
  const long double sin2 = (1 - c * c) / (eta * eta);
  if (sin2 >= 1) return 1;
  const long double ct = std::sqrt(1 - sin2);
  const long double rp = (eta * c - ct) / (eta * c + ct), rs = (c - eta * ct) / (c + eta * ct);
  return (rp * rp + rs * rs) / 2;
}

TEST(HardCases, N16_a_boundary_of_index_one_is_not_there) {
  Stream direction(5), layered(6);
  for (const Ggx roughness : {Ggx{}, Ggx{0.3f, 0.3f}})
    for (const Vec3 wo : outgoing_directions())
      for (int i = 0; i < 100; ++i) {
        const std::optional<BsdfSample> s = sample(DielectricBsdf{1, roughness}, wo, direction, layered);
        ASSERT_TRUE(s);
        EXPECT_EQ(s->wi, -wo);
        EXPECT_EQ(s->weight, Rgb(1));
        EXPECT_TRUE(s->specular && s->transmission);
        EXPECT_EQ(s->eta, 1);
      }
}

TEST(HardCases, N16_an_index_of_one_reflects_exactly_nothing_at_any_angle) {
  for (const float c : {0.0f, 1e-30f, 1e-6f, 0.3f, 1.0f}) EXPECT_EQ(fresnel_dielectric(c, 1), 0);
}

TEST(HardCases, N30_far_and_small_spheres_are_met_where_the_closed_form_says) {
  // b² − 4ac would lose every digit here.
  for (const double distance : {10.0, 1e3, 1e5}) {
    const Geometry g = only({sphere_at({0, 0, 0}, 1e-3), false});
    const Ray ray{Vec3(0, 0, static_cast<float>(-distance)), Vec3(0, 0, 1)};
    const auto hit = g.intersect(ray, kInf);
    ASSERT_TRUE(hit) << distance;
    EXPECT_NEAR(hit->t, distance - 1e-3, 1e-9 * distance);
    const SurfacePoint s = g.surface(*hit, ray);
    EXPECT_NEAR(s.p.z, -1e-3f, 1e-9f);
    EXPECT_NEAR(s.ng.z, -1, 1e-6f);
  }
}

TEST(HardCases, N32_fresnel_keeps_its_digits_for_indices_near_one_and_at_grazing_angles) {
  for (const float eta : {0.4f, 0.7f, 0.999f, 0.99999f, 1.0000001f, 1.00001f, 1.001f, 1.33f, 1.5f, 2.4f, 10.0f})
    for (const float c : {1.0f, 0.999f, 0.7f, 0.5f, 0.1f, 0.01f, 1e-3f, 1e-5f}) {
      const long double expected = reference_dielectric(c, eta);
      // One ulp of cos θ or eta moves the result by more than this only within a hair of the critical angle.
      if (expected > 0.9L && expected < 1 && eta < 1) continue;
      EXPECT_NEAR(static_cast<double>(fresnel_dielectric(c, eta)), static_cast<double>(expected),
                  2e-6 * static_cast<double>(expected) + 1e-20)
          << "eta " << eta << " cos " << c;
    }
}

TEST(HardCases, N32_grazing_light_is_reflected_entirely) {
  for (const float eta : {0.5f, 0.999f, 1.0000001f, 1.5f, 3.0f}) {
    EXPECT_EQ(fresnel_dielectric(0, eta), 1) << eta;
    EXPECT_GT(fresnel_dielectric(1e-8f, eta), 0.99f) << eta;
  }
  EXPECT_EQ(fresnel_conductor(0, 0.2f, 3.9f), 1);
}

TEST(HardCases, N32_poles_and_grazing_directions_stay_finite) {
  std::vector<Vec3> edge;
  for (const float sign : {1.0f, -1.0f}) {
    for (const Vec3 w : {Vec3(1, 0, 0), Vec3(0, 1, 0), Vec3(0, 0, 1)}) edge.push_back(sign * w);
    for (const float z : {0.0f, -0.0f, 1e-38f, 1e-20f, 1e-8f, 1e-4f})
      edge.push_back({std::sqrt(1 - z * z), 0, sign * z}), edge.push_back({0, -1, sign * z});
  }
  std::vector<BsdfCase> cases = bsdf_cases();
  cases.push_back({"barely rough dielectric", DielectricBsdf{1.5f, Ggx::from_alpha(1e-3f, 1e-3f)}});
  cases.push_back({"one-way brushed conductor", ConductorBsdf{Rgb(0.2f), Rgb(3.9f), Ggx::from_alpha(1, 0)}});
  cases.push_back({"nearly matched rough dielectric", DielectricBsdf{1.000001f, {0.3f, 0.3f}}});
  for (const BsdfCase& c : cases) {
    int samples = 0;
    for (const Vec3 wo : edge) {
      Stream direction(12), layered(13);
      for (const Vec3 wi : edge) {
        EXPECT_TRUE(is_finite(eval(c.bsdf, wo, wi, layered))) << c.name;
        EXPECT_TRUE(std::isfinite(pdf(c.bsdf, wo, wi))) << c.name << " " << wo.z << " " << wi.z;
      }
      EXPECT_TRUE(is_finite(albedo(c.bsdf, wo))) << c.name;
      for (int i = 0; i < 200; ++i) {
        const std::optional<BsdfSample> s = sample(c.bsdf, wo, direction, layered);
        if (!s) continue;
        ++samples;
        EXPECT_TRUE(is_finite(s->wi) && is_finite(s->weight) && std::isfinite(s->pdf)) << c.name << " wo.z " << wo.z;
        EXPECT_TRUE(s->weight.r >= 0 && s->weight.g >= 0 && s->weight.b >= 0) << c.name;
        EXPECT_TRUE(is_finite(eval(c.bsdf, wo, s->wi, layered))) << c.name;
      }
    }
    EXPECT_GT(samples, 0) << c.name;
  }
}

TEST(HardCases, N63_the_plane_of_a_huge_triangle_is_not_met_again) {
  // The bound must not grow with the triangle, however the plane is cut.
  int away_from_edges = 0;
  for (const int cuts : {1, 7, 64}) {
    const Geometry g = only({plane(1e4f, cuts), false});
    Stream random(2);
    for (int i = 0; i < 20000; ++i) {
      const Vec3 from(random.uniform2() * 2.0f - 1.0f, 0.3f + random.uniform());
      const Vec3 down = glm::normalize(Vec3(random.uniform2() * 2.0f - 1.0f, -0.2f));
      const Ray ray{from, down};
      const auto hit = g.intersect(ray, kInf);
      ASSERT_TRUE(hit);
      const double exact = ray.o.z / -ray.d.z;
      // At an edge the hit is moved onto the triangle that the ray caster found.
      if (!g.is_at_edge(ray, *hit)) {
        ++away_from_edges;
        EXPECT_NEAR(hit->t, exact, 1e-9 * exact) << cuts << " " << i;
      }
      const SurfacePoint s = g.surface(*hit, ray);
      EXPECT_LT(std::abs(s.p.z), 1e-9f);
      const Vec3 grazing = glm::normalize(Vec3(random.uniform2() * 2.0f - 1.0f, 1e-4f));
      const Vec3 origin = offset_origin(s, grazing);
      EXPECT_FALSE(g.intersect({origin, grazing}, kInf)) << cuts << " " << i;
      EXPECT_FALSE(g.occluded({origin, grazing}, 1e3, {})) << cuts << " " << i;
    }
  }
  EXPECT_GT(away_from_edges, 50000);
}

// Rays through the vertices and the edges of a closed mesh, in both orders of its vertices. Along edges every one enters and
// leaves. At a vertex that a ray meets to within a rounding the ray caster may find none of its triangles (one ray in four
// hundred that are aimed at one, none otherwise): what matters is that a ray which met one side only still knows where it is,
// since the side of the last hit says the medium and no crossings are counted.
TEST(HardCases, N28_rays_through_vertices_and_edges_end_outside) {
  constexpr int kRings = 12, kSectors = 24;
  for (const bool turned : {false, true}) {
    Mesh ball;
    for (int i = 0; i <= kRings; ++i)
      for (int j = 0; j < kSectors; ++j) {
        const double theta = M_PI * i / kRings, phi = 2 * M_PI * j / kSectors;
        ball.positions.push_back(Vec3(DVec3(std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta))));
      }
    for (int i = 0; i < kRings; ++i)
      for (int j = 0; j < kSectors; ++j) {
        // Every pole is one vertex, so that the mesh is closed.
        const auto at = [&](int ring, int sector) {
          return static_cast<uint32_t>(ring == 0 ? 0 : ring == kRings ? kRings * kSectors : ring * kSectors + sector % kSectors);
        };
        const uint32_t a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
        for (std::array<uint32_t, 3> t : {std::array<uint32_t, 3>{a, b, c}, std::array<uint32_t, 3>{a, c, d}}) {
          if (t[0] == t[1] || t[1] == t[2] || t[0] == t[2]) continue;
          if (turned) t = {t[1], t[2], t[0]};
          ball.triangles.push_back(t);
        }
      }
    const std::vector<DVec3> positions = ball.positions;
    const auto triangles = ball.triangles;
    const Geometry g = only({ball, false});
    Stream random(7);
    std::vector<DVec3> on_edges;
    for (const auto& t : triangles)
      for (const double share : {0.5, 0.25}) on_edges.push_back(share * positions[t[0]] + (1 - share) * positions[t[1]]);
    for (const bool vertices : {true, false}) {
      int rays = 0, fell_through = 0;
      for (const DVec3 target : vertices ? positions : on_edges)
        for (int k = 0; k < 20; ++k) {
          // From far outside through the point; rays that nearly touch the ball may rightly miss it.
          const DVec3 origin(5.0f * square_to_sphere(random.uniform2()));
          Ray ray{origin, glm::normalize(target - origin)};
          if (std::abs(glm::dot(ray.d, glm::normalize(target))) < 0.3) continue;
          ++rays;
          bool inside = false;
          int hits = 0;
          while (const auto hit = g.intersect(ray, kInf)) {
            const SurfacePoint s = g.surface(*hit, ray);
            inside = glm::dot(ray.d, DVec3(s.ng)) < 0;
            ASSERT_LE(++hits, 4);
            ray.o = offset_origin(s, ray.d);
          }
          fell_through += hits < 2;
          EXPECT_FALSE(inside) << "the last side met is the inner one";
        }
      EXPECT_GT(rays, 3000);
      EXPECT_LE(fell_through, vertices ? rays / 100 : 0);
    }
  }
}

}  // namespace
}  // namespace woodcock::testing
