// What one path reports beside its radiance, and what its random numbers depend on (tests/hard_cases has more).
#include "renderer/transport/path.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

/// What `samples` paths through the middle of the picture saw.
std::vector<PathResult> look(const std::string& text, int samples) {
  const CompiledScene scene = compile(text);
  PathCounters counters;
  std::vector<PathResult> seen;
  for (int i = 0; i < samples; ++i) {
    const PathKey key = path_key(1, 4, 4, static_cast<uint64_t>(i));
    const CameraSample camera = camera_sample(*scene.world, key, 4, 4);
    seen.push_back(trace_path(*scene.world, {*scene.world, scene.settings}, camera.ray, key, counters));
  }
  return seen;
}
/// Straight at the origin along `direction` from the distance `distance`.
std::string towards_origin(DVec3 direction, double distance) {
  return perspective(glm::normalize(direction) * distance, {0, 0, 0}, 0.01, 5) + "WorldBegin\n" + environment(1);
}
void expect_near(Vec3 a, Vec3 b, float tolerance) { EXPECT_LE(glm::length(a - b), tolerance) << a.x << ' ' << a.y << ' ' << a.z; }

TEST(FirstEvent, IsReportedInWorldUnitsAndWorldSpace) {
  const DVec3 from(1, 2, 3);
  const Vec3 normal = Vec3(glm::normalize(from));
  for (const float s : {1e-3f, 1.0f, 1e4f}) {
    const PathResult r =
        look(towards_origin(from, 5.0 * s) + "Material \"diffuse\" \"rgb reflectance\" [ .1 .2 .3 ]\n" + sphere(2.0 * s), 1)[0];
    EXPECT_NEAR(r.depth, 3 * s, 1e-5f * s);
    expect_near(r.normal, normal, 1e-3f);
    expect_near(r.albedo, {0.1f, 0.2f, 0.3f}, 1e-6f);
  }
}

TEST(FirstEvent, LiesBehindInterfacesAndWhatIsNotThere) {
  // Four interfaces and a surface whose opacity is a half lie before the ball; the depth is that of the whole way.
  const std::string text =
      towards_origin({0, 0, 1}, 10) + boundary("", "", sphere(4)) + boundary("", "", sphere(3)) +
      "Material \"diffuse\" \"rgb reflectance\" [ .4 .4 .4 ]\nShape \"sphere\" \"float radius\" 2 \"float alpha\" 0.5\n" +
      "Material \"diffuse\" \"rgb reflectance\" [ .2 .2 .2 ]\n" + sphere(1);
  int outer = 0;
  for (const PathResult& r : look(text, 200)) {
    const bool hit = std::abs(r.depth - 8) < 1e-3;
    outer += hit;
    EXPECT_NEAR(r.depth, hit ? 8 : 9, 1e-4);
    EXPECT_NEAR(r.albedo.r, hit ? 0.4 : 0.2, 1e-6);
    expect_near(r.normal, {0, 0, 1}, 1e-3f);
  }
  // Binomial with 200 trials: outside of 100 ± 36 once in three million seeds.
  EXPECT_NEAR(outer, 100, 36);
}

TEST(FirstEvent, InAMediumHasItsAlbedoAndNoNormal) {
  for (const PathResult& r :
       look(towards_origin({0, 0, 1}, 10) + homogeneous("m", {1e6f, 0, 3e6f}, Rgb(1e6f)) + boundary("m", "", sphere(4)), 20)) {
    EXPECT_NEAR(r.depth, 6, 1e-3);
    expect_near(r.albedo, {0.5f, 1, 0.25f}, 1e-5f);
    EXPECT_EQ(r.normal, Vec3(0));
  }
}

TEST(FirstEvent, IsNothingWhereTheRayLeaves) {
  const PathResult r = look(towards_origin({0, 0, 1}, 10) + boundary("", "", sphere(4)), 1)[0];
  EXPECT_EQ(r.depth, 0);
  EXPECT_EQ(r.albedo, Rgb(0));
  EXPECT_EQ(r.normal, Vec3(0));
}

TEST(FirstEvent, NormalsOfInstancesAreOfTheWorld) {
  // A disk that faces +z in its object, turned to +x and mirrored by the instance.
  const PathResult r = look(
      towards_origin({1, 0, 0}, 10) + "ObjectBegin \"o\"\nShape \"disk\"\nObjectEnd\nRotate 90 0 1 0\nScale 1 -2 3\nObjectInstance \"o\"\n",
      1)[0];
  EXPECT_NEAR(std::abs(r.normal.x), 1, 1e-6);
  EXPECT_NEAR(r.depth, 10, 1e-4);
}

TEST(RandomNumbers, AreNotShiftedByWhatNoRayMeets) {
  // A closed room with a ball of fog, smooth and rough glass.
  const std::string room =
      "Material \"diffuse\" \"rgb reflectance\" [ .6 .6 .6 ]\nAttributeBegin\nAreaLightSource \"diffuse\" \"rgb L\" [ 2 1 1 ]\n"
      "ReverseOrientation\n" +
      sphere(3) + "AttributeEnd\n" + sphere(0.6, {-1, 0, 0}) + boundary("fog", "", sphere(0.7, {1, 0, 0})) +
      "Material \"dielectric\" \"float roughness\" 0.2\n" + sphere(0.5, {0, 1.2, 0});
  const std::string camera = perspective({0, 0.2, 2.5}, {0, 0, 0}, 60, 8), fog = homogeneous("fog", Rgb(0.1f), Rgb(2), 0.3);
  const auto bits = [&](const std::string& media, const std::string& shapes) {
    return radiances(compile(camera + "WorldBegin\n" + fog + media + room + shapes), 4000, 1);
  };
  const std::vector<Rgb> reference = bits("", "");
  // A chromatic medium that no boundary leads into.
  EXPECT_EQ(bits(homogeneous("unused", {1, 2, 3}, {3, 2, 1}, 0, Rgb(5)), ""), reference);
  // Boundaries, opacity and media inside of a closed opaque ball.
  EXPECT_EQ(bits(homogeneous("used", {1, 2, 3}, {3, 2, 1}, 0, Rgb(5)),
                 boundary("used", "", sphere(0.2, {-1, 0, 0})) + "Material \"diffuse\"\nAttributeBegin\nTranslate -1 0 0\nShape \"sphere\" "
                                                                 "\"float radius\" 0.1 \"float alpha\" 0.3\nAttributeEnd\n"),
            reference);
}

// A boundary without a difference on the way of all rays moves their origins by a rounding and nothing else: the same
// numbers are drawn, so that all but the paths that a rounding sends another way stay what they were.
TEST(RandomNumbers, AreNotShiftedByBoundariesWithoutADifference) {
  const std::string scene = perspective({0, 0, 4}, {0, 0, 0}, 30, 8) + "WorldBegin\n" + environment(1) + "Material \"diffuse\"\n" +
                            sphere(1) + sphere(0.5, {0, 1.3, 0.3});
  const std::vector<Rgb> reference = radiances(compile(scene), 4000, 1),
                         shelled = radiances(compile(scene + boundary("", "", sphere(2.5))), 4000, 1);
  size_t close = 0;
  for (size_t i = 0; i < reference.size(); ++i) close += glm::length(reference[i] - shelled[i]) <= 1e-4f * (1 + glm::length(reference[i]));
  EXPECT_GE(close, reference.size() * 99 / 100);
}

}  // namespace
}  // namespace woodcock::testing
