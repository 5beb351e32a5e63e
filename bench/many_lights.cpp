// many_lights [--seconds S]: up to a thousand lights in fog, chosen by what arrives at the point against by power, as a table
// in Markdown. The scene is made here: lights of three kinds and a range of 256 in power over a street of 40 × 40 × 6 units.
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <fstream>
#include <string>

#include "bench/contest.h"
#include "renderer/core/random.h"

namespace {

using namespace woodcock;
using namespace woodcock::bench;

std::string scene_of(int lights, double density) {
  std::string text = fmt::format(
      "MakeNamedMedium \"fog\" \"string type\" \"homogeneous\" \"rgb sigma_s\" [ {0} {0} {0} ] \"rgb sigma_a\" [ {1} {1} {1} ]\n"
      "LookAt 0 -24 5  0 0 1  0 0 1\nMediumInterface \"\" \"fog\"\nCamera \"perspective\" \"float fov\" 50\n"
      "Film \"rgb\" \"integer xresolution\" 96 \"integer yresolution\" 64\nIntegrator \"volpath\" \"integer maxdepth\" 8\n"
      "WorldBegin\nMediumInterface \"fog\" \"fog\"\nMaterial \"diffuse\" \"rgb reflectance\" [ 0.4 0.4 0.4 ]\n"
      "Shape \"disk\" \"float radius\" 60\n",
      density, density / 10);
  Stream random(0x6c616d7073ULL);
  const auto uniform = [&](double a, double b) { return a + (b - a) * random.uniform_double(); };
  for (int i = 0; i < lights; ++i) {
    const double x = uniform(-20, 20), y = uniform(-20, 20), z = uniform(0.3, 6), power = std::exp2(uniform(-4, 4));
    if (i % 3 == 0) {
      text += fmt::format("LightSource \"point\" \"point3 from\" [ {0} {1} {2} ] \"rgb I\" [ {3} {3} {3} ]\n", x, y, z, power);
    } else if (i % 3 == 1) {
      text += fmt::format(
          "LightSource \"spot\" \"point3 from\" [ {0} {1} {2} ] \"point3 to\" [ {3} {4} 0 ] \"float coneangle\" 35 \"rgb I\" [ {5} {5} {5} "
          "]\n",
          x, y, z, x + uniform(-1, 1), y + uniform(-1, 1), 4 * power);
    } else {
      text += fmt::format(
          "AttributeBegin\nTranslate {0} {1} {2}\nAreaLightSource \"diffuse\" \"rgb L\" [ {3} {3} {3} ]\nShape \"sphere\" \"float radius\" "
          "0.05\nAttributeEnd\n",
          x, y, z, power * 100);
    }
  }
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  double seconds = 1;
  if (argc == 3 && std::string(argv[1]) == "--seconds") seconds = std::atof(argv[2]);
  if ((argc != 1 && argc != 3) || !(seconds > 0)) {
    fmt::print(stderr, "usage: many_lights [--seconds S], S above 0\n");
    return 2;
  }
  const std::filesystem::path file = std::filesystem::temp_directory_path() / "woodcock_many_lights.pbrt";
  try {
    fmt::print(
        "| lights | mean free path | efficiency of choosing by what arrives over by power | all rounds together | samples | bias |\n"
        "|---|---|---|---|---|---|\n");
    for (const int lights : {10, 100, 1000})
      for (const double density : {0.02, 0.2}) {
        std::ofstream(file) << scene_of(lights, density);
        std::vector<Contender> contenders(2);
        contenders[0].name = "auto";
        contenders[1].name = "auto without light-tree";
        contenders[1].settings.without = "light-tree";
        const auto outcomes = contest(file.string(), contenders, seconds);
        fmt::print("| {} | {:.0f} | {} | {} | {} : {} | {} |\n", lights, 1 / (1.1 * density),
                   format(efficiency_ratio(outcomes[0], outcomes[1])), three_digits(pooled_efficiency_ratio(outcomes[0], outcomes[1])),
                   outcomes[0].samples, outcomes[1].samples, format_mean(outcomes[1].bias));
        std::fflush(stdout);
      }
  } catch (const std::exception& error) {
    fmt::print(stderr, "many_lights: {}\n", error.what());
    return 1;
  }
  std::filesystem::remove(file);
  return 0;
}
