// Where coefficients differ between channels, each channel is what a grey scene with its coefficients shows: in every
// container, with a channel that does not scatter or is not attenuated at all.
#include <gtest/gtest.h>

#include "tests/transport/estimate.h"

namespace woodcock::testing {
namespace {

struct Coefficients {
  std::string name;
  Rgb sigma_a, sigma_s;
};
const std::array<Coefficients, 3> kCases{{{"red does not scatter, blue does not absorb", {0.2f, 0.5f, 0}, {0, 1, 4}},
                                          {"equal extinction, red does not scatter", {2, 0, 1}, {0, 2, 1}},
                                          {"equal extinction, green does not scatter", {0, 2, 1}, {2, 0, 1}}}};

using Container = std::string (*)(Rgb sigma_a, Rgb sigma_s, Rgb emission);
const std::array<Container, 3> kContainers{{[](Rgb a, Rgb s, Rgb e) { return homogeneous("m", a, s, 0.3, e); },
                                            [](Rgb a, Rgb s, Rgb e) { return constant_grid("m", a, s, 1.5, 0.3, e); },
                                            [](Rgb a, Rgb s, Rgb e) { return constant_rgb_grid("m", a, s, 1.5, 0.3, e); }}};

/// A ball of the medium before a dim environment, lit by a lamp at its side; the medium glows.
std::string scene(Container container, Rgb sigma_a, Rgb sigma_s) {
  return perspective({0, 0, 4}, {0, 0, 0}, 25, 1000) + "WorldBegin\n" + environment(0.5f) +
         "LightSource \"point\" \"point3 from\" [ 2 0 1 ] \"rgb I\" [ 5 5 5 ]\n" + container(sigma_a, sigma_s, Rgb(0.3f)) +
         boundary("m", "", sphere(1));
}

/// Compares every container with the grey scenes of its channels.
void expect_grey_channels(const Coefficients& k) {
  std::array<Estimate, 3> grey;
  for (int c = 0; c < 3; ++c) grey[c] = estimate(scene(kContainers[0], Rgb(k.sigma_a[c]), Rgb(k.sigma_s[c])), 30000, 11);
  Estimate expected = grey[0];
  for (size_t c = 0; c < 3; ++c) {
    expected.mean[c] = grey[c].mean[c];
    expected.error[c] = grey[c].error[c];
  }
  for (size_t i = 0; i < kContainers.size(); ++i)
    expect_equal(estimate(scene(kContainers[i], k.sigma_a, k.sigma_s), 40000, 12 + i), expected, 0.02,
                 k.name + ", container " + std::to_string(i));
}

TEST(HardCases, N20_each_channel_is_the_grey_scene_of_its_coefficients) {
  for (const Coefficients& k : kCases) expect_grey_channels(k);
}

TEST(HardCases, N57_a_channel_without_extinction_is_right) {
  expect_grey_channels({"green is empty", {1, 0, 0.5f}, {1, 0, 3}});
  expect_grey_channels({"red and blue are empty", {0, 0.5f, 0}, {0, 3, 0}});
}

// The mixture over channels keeps the sum of the throughputs (white_furnace_test.cpp sees the means). The glass hides
// the environment from light samples, so that a sample is the throughput of its path.
TEST(HardCases, N20_no_sample_of_a_chromatic_furnace_is_brighter_than_three_times_it) {
  for (const Container container : kContainers) {
    const CompiledScene furnace = compile(perspective({0, 0, 4}, {0, 0, 0}, 25, 1000000) + "WorldBegin\n" + environment(1) +
                                          container(Rgb(0), {0.1f, 1, 30}, Rgb(0)) +
                                          "Material \"dielectric\" \"float eta\" 1\nMediumInterface \"m\" \"\"\n" + sphere(1));
    for (const Rgb sample : radiances(furnace, 5000, 3)) ASSERT_LE(sample.r + sample.g + sample.b, 3.001f);
  }
}

}  // namespace
}  // namespace woodcock::testing
