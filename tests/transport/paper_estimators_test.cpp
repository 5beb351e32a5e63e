// The estimators of the paper against closed forms, against quadrature for every subset of the terms, and against `auto`; and the
// bias of those that march.
//
// False alarms: see tests/transport/estimate.h.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

constexpr double kStep = 0.25;

/// All but `auto`, with steps that are neither tiny nor a part of the scenes' lengths.
std::vector<EstimatorChoice> paper_estimators() {
  std::vector<EstimatorChoice> list;
  for (const EstimatorInfo& e : estimators())
    if (std::string(e.name) != "auto") list.push_back({e.name, e.step ? kStep : 0});
  return list;
}
std::vector<EstimatorChoice> that_scatter() {
  auto list = paper_estimators();
  std::erase_if(list, [](const EstimatorChoice& c) { return !find_estimator(c.name)->media_scatter; });
  return list;
}
bool uses_phase_sampling(const EstimatorChoice& c) { return c.name == "line" || c.name.ends_with("-phase"); }
/// A march sends a branch from every step.
int samples_for(const EstimatorChoice& c, int samples) { return c.name.starts_with("march") ? samples / 6 : samples; }

/// A narrow view along a diameter of the ball of radius 1.
std::string along_a_diameter(const std::string& medium, Rgb background, int max_depth) {
  return perspective({0, 0, 4}, {0, 0, 0}, 0.1, max_depth) + "WorldBegin\n" + environment(background) + medium +
         boundary("m", "", sphere(1));
}

double simpson(double a, double b, int n, const std::function<double(double)>& f) {
  const double h = (b - a) / n;
  double sum = f(a) + f(b);
  for (int i = 1; i < n; ++i) sum += (i % 2 != 0 ? 4 : 2) * f(a + i * h);
  return sum * h / 3;
}

/// What is seen along the diameter of a ball of radius 1 with at most one scattering, isotropic: along each way of length d,
/// I(d) = j (1 − e^(−σt d))/σt + e^(−σt d) E, and at depth s the in-scattered light is the mean of I over all directions.
double single_scattering(double sigma_t, double sigma_s, double j, double background) {
  const auto along = [&](double d) {
    return (sigma_t > 0 ? j * -std::expm1(-sigma_t * d) / sigma_t : j * d) + std::exp(-sigma_t * d) * background;
  };
  const auto in_scattered = [&](double s) {
    const double r = std::abs(1 - s);
    return simpson(-1, 1, 200, [&](double mu) { return 0.5 * along(-r * mu + std::sqrt(std::max(0.0, 1 - r * r * (1 - mu * mu)))); });
  };
  return along(2) + simpson(0, 2, 200, [&](double s) { return std::exp(-sigma_t * s) * sigma_s * in_scattered(s); });
}

std::string name_of(const TransferTerms& t) {
  return fmt::format("{}{}{}{}", t.absorption ? "absorption " : "", t.emission ? "emission " : "",
                     t.out_scattering ? "out-scattering " : "", t.in_scattering ? "in-scattering" : "");
}

// Every subset of the terms, in three channels of different coefficients of which one has no absorption and so no emission.
TEST(PaperEstimators, ShowExactlyTheTermsThatCount) {
  const Rgb sigma_a(0.6f, 0.0f, 1.1f), sigma_s(0.5f, 0.9f, 0.2f), le(2, 5, 1), background(0.3f, 0.5f, 0.2f);
  for (int subset = 1; subset < 16; ++subset) {
    const TransferTerms terms{(subset & 1) != 0, (subset & 2) != 0, (subset & 4) != 0, (subset & 8) != 0};
    std::array<double, 3> expected{};
    for (int c = 0; c < 3; ++c) {
      expected[static_cast<size_t>(c)] =
          single_scattering(static_cast<double>((terms.absorption ? sigma_a[c] : 0) + (terms.out_scattering ? sigma_s[c] : 0)),
                            static_cast<double>(terms.in_scattering ? sigma_s[c] : 0),
                            static_cast<double>(terms.emission ? sigma_a[c] * le[c] : 0), static_cast<double>(background[c]));
    }
    for (const std::string& medium : {homogeneous("m", sigma_a, sigma_s, 0, le), constant_rgb_grid("m", sigma_a, sigma_s, 1.5, 0, le)}) {
      for (const EstimatorChoice& choice : paper_estimators()) {
        if (terms.in_scattering && !find_estimator(choice.name)->media_scatter) continue;
        const CompiledScene scene = with_estimator(compile(along_a_diameter(medium, background, 1), terms), choice);
        expect_value(estimate(scene, samples_for(choice, 16000), 1), expected, 0.045,
                     choice.name + " " + name_of(terms) + medium.substr(0, 60));
      }
    }
  }
}

TEST(PaperEstimators, FindALosslessMediumInvisibleInAFurnace) {
  for (const double g : {0.0, 0.6}) {
    for (const EstimatorChoice& choice : that_scatter()) {
      if (g != 0 && !uses_phase_sampling(choice)) continue;
      for (const std::string& medium : {homogeneous("m", Rgb(0), Rgb(3, 1, 0), g), constant_grid("m", Rgb(0), Rgb(3), 1.5, g)}) {
        const std::string text =
            perspective({0, 0, 4}, {0, 0, 0}, 25, 100000) + "WorldBegin\n" + environment(1) + medium + boundary("m", "", sphere(1));
        expect_value(estimate(with_estimator(compile(text), choice), samples_for(choice, 6000), 2), 1, 0.02,
                     choice.name + fmt::format(" g {}", g));
      }
    }
  }
}

// P12: isotropic scattering of all orders in a ball, albedo 0.8, optical radius 2 (Peierls' equation).
TEST(PaperEstimators, MeetAnExactValueOfMultipleScattering) {
  for (const EstimatorChoice& choice : that_scatter()) {
    const std::string text = along_a_diameter(homogeneous("m", Rgb(0.4f), Rgb(1.6f)), Rgb(1), 100000);
    expect_value(estimate(with_estimator(compile(text), choice), samples_for(choice, 60000), 3), 0.5362800050144848, 0.004, choice.name);
  }
}

// Several directions or distances are another way to the same mean.
TEST(PaperEstimators, BranchWithoutChangingTheMean) {
  const std::string ball = along_a_diameter(homogeneous("m", Rgb(0.4f), Rgb(1.6f), 0.3), Rgb(1), 100);
  const Estimate exact = estimate(ball, 60000, 4);
  for (const EstimatorChoice& choice : {EstimatorChoice{"march", 0.5, 3}, {"march-phase", 0.5, 3}, {"line", 0.5, 5}})
    expect_equal(estimate(with_estimator(compile(ball), choice), 8000, 5), exact, 0.02, choice.name);
  const std::string room = perspective({0.1, 0.2, 0.3}, {1, 0.5, 0.2}, 90, 2) +
                           "WorldBegin\nMaterial \"diffuse\" \"rgb reflectance\" [ .6 .6 .6 ]\n"
                           "AreaLightSource \"diffuse\" \"rgb L\" [ 2 2 2 ]\nReverseOrientation\n" +
                           sphere(1);
  expect_value(estimate(with_estimator(compile(room), {"uniform-path", 0, 1, 4}), 20000, 6), 2 * 1.96, 2e-3, "branching");
}

// Distances go on across boundaries that change nothing, and stop at surfaces.
TEST(PaperEstimators, CrossBoundariesAndGlass) {
  const std::string medium = homogeneous("m", Rgb(0.2f), Rgb(0.8f, 0.5f, 1.2f), 0);
  const std::string shells = boundary("m", "m", sphere(0.9)) + boundary("m", "m", sphere(0.5, {0.1, 0, 0.2}));
  const std::string glass =
      "AttributeBegin\nMaterial \"dielectric\" \"float eta\" 1.4\nMediumInterface \"m\" \"\"\n" + sphere(1) + "AttributeEnd\n";
  const std::string camera = perspective({0, 0, 4}, {0, 0, 0}, 20, 60) + "WorldBegin\n" + environment({1, 0.5f, 0.25f});
  const std::string plate = "Material \"diffuse\" \"rgb reflectance\" [ .5 .7 .2 ]\n" + sphere(0.3, {0.2, 0.1, 0});
  for (const std::string& scene : {camera + medium + boundary("m", "", sphere(1)) + shells + plate, camera + medium + glass + plate}) {
    const Estimate exact = estimate(scene, 60000, 7);
    for (EstimatorChoice choice : that_scatter()) {
      choice.directions = choice.name == "line" ? 3 : 1;
      expect_equal(estimate(with_estimator(compile(scene), choice), samples_for(choice, 24000), 8), exact, 0.03, choice.name);
    }
  }
}

// Media that add up, with an end and without one. In what has no end some channels are dimmed for ever and others not at all
// (N57): by quadrature, with no scattering but the first.
TEST(PaperEstimators, CrossSumsOfMedia) {
  const std::string parts = homogeneous("a", {0.2f, 0.1f, 0}, {0.3f, 0.1f, 0}) + constant_grid("b", {0, 0.2f, 0.1f}, {0, 0.3f, 0.6f}, 0.7);
  const std::string media = parts + "MakeNamedMedium \"s\" \"string type\" \"sum\" \"string media\" [ \"a\" \"b\" ]\n";
  const std::string sky = "WorldBegin\n" + environment({1, 0.5f, 0.25f});
  const std::string ball = perspective({0, 0, 3}, {0, 0, 0}, 20, 40) + sky + media + boundary("s", "", sphere(1));
  const Estimate exact = estimate(ball, 40000, 16);
  for (const EstimatorChoice& choice : that_scatter())
    expect_equal(estimate(with_estimator(compile(ball), choice), samples_for(choice, 24000), 17), exact, 0.06, choice.name);

  // Without an end, seen with no scattering: the light behind, through the grid in blue, through what has no end in the others. It
  // reaches one and a half voxels of 1.4 beyond the middle on either side and fades in the last half: 3 · 1.4 long in all.
  const std::string unbounded = media + "MediumInterface \"\" \"s\"\n" + perspective({0, 0, 3}, {0, 0, 0}, 0.1, 0) + sky;
  const CompiledScene scene = compile(unbounded);
  const Ray ray = camera_sample(*scene.world, path_key(1, 4, 4, 0), 4, 4).ray;
  double depth = 0;
  constexpr int kPoints = 20000;
  const double length = 6 * scene.world->space.scale;
  for (int i = 0; i < kPoints; ++i)
    depth += static_cast<double>(
                 scene.world->media[scene.world->camera_medium].sigma_t(ray.at(static_cast<float>((i + 0.5) / kPoints * length))).b) *
             length / kPoints;
  for (const EstimatorChoice& choice : paper_estimators())
    expect_value(estimate(with_estimator(compile(unbounded), choice), 20000, 18), {0, 0, 0.25 * std::exp(-depth)}, 0.05, choice.name);
}

// Uniform directions reach every lobe of every material: the same light as by light and material sampling.
TEST(PaperEstimators, SeeEveryMaterial) {
  const std::string sky = perspective({0, 0, 4}, {0, 0, 0}, 25, 3) + "WorldBegin\n" + environment({1, 0.8f, 0.6f});
  const std::string floor =
      "Material \"diffuse\" \"rgb reflectance\" [ .3 .5 .7 ]\nAttributeBegin\nTranslate 0 -1.2 0\nRotate -90 1 0 0\n"
      "Shape \"disk\" \"float radius\" 3\nAttributeEnd\n";
  for (const std::string material : {"\"diffuse\"", "\"diffusetransmission\"", "\"dielectric\"", "\"dielectric\" \"float roughness\" 1",
                                     "\"thindielectric\"", "\"conductor\" \"float roughness\" 0.5", "\"conductor\" \"float roughness\" 0",
                                     "\"coateddiffuse\" \"float roughness\" 0", "\"coateddiffuse\" \"float roughness\" 0.4",
                                     "\"coatedconductor\" \"float interface.roughness\" 0 \"float conductor.roughness\" 0.5"}) {
    const std::string scene = sky + floor + "Material " + material + "\n" + sphere(1);
    // The values of rough glass have a long tail.
    const double resolution = material.find("roughness\" 1") != std::string::npos ? 0.08 : 0.03;
    expect_equal(estimate(with_estimator(compile(scene), {"uniform-path"}), 80000, 9), estimate(scene, 30000, 10), resolution, material);
  }
}

TEST(PaperEstimators, ReportTheFirstEvent) {
  // Behind a boundary a ball of thin fog and in it a plate: albedo, normal and depth as `auto` has them.
  const std::string scene = perspective({0, 0, 4}, {0, 0, 0}, 0.1, 3) + "WorldBegin\n" + environment(1) +
                            homogeneous("m", {0.3f, 0.1f, 0.2f}, {0.3f, 0.5f, 0.4f}) + boundary("m", "", sphere(1)) +
                            "Material \"diffuse\" \"rgb reflectance\" [ .1 .2 .3 ]\n" + sphere(0.4);
  const auto mean = [](const CompiledScene& s, int samples) {
    PathCounters counters;
    std::array<double, 7> sum{};
    for (int i = 0; i < samples; ++i) {
      const PathKey key = path_key(1, 4, 4, static_cast<uint64_t>(i));
      const PathResult r = s.radiance(*s.world, {*s.world, s.settings}, camera_sample(*s.world, key, 4, 4).ray, key, counters);
      for (int c = 0; c < 3; ++c) {
        sum[static_cast<size_t>(c)] += static_cast<double>(r.albedo[c]) / samples;
        sum[static_cast<size_t>(3 + c)] += static_cast<double>(r.normal[c]) / samples;
      }
      sum[6] += static_cast<double>(r.depth) / samples;
    }
    return sum;
  };
  const auto expected = mean(compile(scene), 20000);
  for (EstimatorChoice choice : that_scatter()) {
    choice.directions = choice.name == "line" ? 4 : 1;
    const auto got = mean(with_estimator(compile(scene), choice), 20000);
    // Each value lies in [0, 4] with a spread below 0.5: 5 standard errors of a difference of means are below 0.025.
    for (size_t i = 0; i < got.size(); ++i) EXPECT_NEAR(got[i], expected[i], 0.025) << choice.name << " value " << i;
  }
}

TEST(PaperEstimators, DependOnTheKeyAlone) {
  const CompiledScene scene = compile(along_a_diameter(constant_grid("m", Rgb(0.4f), Rgb(1.6f), 1.5), Rgb(1), 50));
  for (const EstimatorChoice& choice : that_scatter()) {
    const CompiledScene s = with_estimator(compile(along_a_diameter(constant_grid("m", Rgb(0.4f), Rgb(1.6f), 1.5), Rgb(1), 50)), choice);
    const std::vector<Rgb> once = radiances(s, 500, 13), again = radiances(s, 1000, 13);
    EXPECT_TRUE(std::equal(once.begin(), once.end(), again.begin())) << choice.name;
  }
  EXPECT_NE(radiances(scene, 100, 13), radiances(scene, 100, 14));
}

// An unbounded medium that glows and absorbs nothing has no finite radiance: the sample says so instead of running for ever.
TEST(PaperEstimators, AreInfiniteWhereTheLightIs) {
  const std::string text = homogeneous("m", Rgb(0.5f), Rgb(0), 0, Rgb(1)) + "MediumInterface \"\" \"m\"\n" +
                           perspective({0, 0, 0}, {1, 0, 0}, 30, 5) + "WorldBegin\n";
  for (const EstimatorChoice& choice : paper_estimators()) {
    const CompiledScene scene = with_estimator(compile(text, {.absorption = false}), choice);
    EXPECT_EQ(radiances(scene, 1, 1)[0], Rgb(kInf)) << choice.name;
    expect_value(estimate(with_estimator(compile(text), choice), 4000, 15), 1, 0.03, choice.name);
  }
}

}  // namespace
}  // namespace woodcock::testing
