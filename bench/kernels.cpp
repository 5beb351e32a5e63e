// kernels [--seconds S]: for every scene in scenes/, what the effect plan gains: the time of a sample with the kernel of all effects
// over that with the scene's own (the same bits), and the efficiency over the general algorithm without a plan.
#include <fmt/format.h>

#include <cstdlib>
#include <exception>
#include <string>

#include "bench/contest.h"

int main(int argc, char** argv) {
  using namespace woodcock::bench;
  double seconds = 1;
  if (argc == 3 && std::string(argv[1]) == "--seconds") seconds = std::atof(argv[2]);
  if ((argc != 1 && argc != 3) || !(seconds > 0)) {
    fmt::print(stderr, "usage: kernels [--seconds S]\n");
    return 2;
  }
  try {
    fmt::print("| scene | time, full kernel : specialised | efficiency, plan on : off | time, plan off : on |\n|---|---|---|---|\n");
    for (const std::string scene :
         {"sphere", "cornell", "milk", "cloud", "fire", "fog", "effects", "paper/fig03", "paper/fig05", "paper/fig09"}) {
      Contender with{"auto", {}}, full{"full kernel", {}}, off{"no plan", {}};
      with.settings.resolution = {{64, 48}};
      full.settings = off.settings = with.settings;
      full.settings.full_kernel = true;
      off.settings.plan = false;
      const auto outcomes = contest(std::string(WOODCOCK_SOURCE_DIR "/scenes/") + scene + ".pbrt", {with, full, off}, seconds);
      fmt::print("| {} | {} | {} | {} |\n", scene, format(time_ratio(outcomes[1], outcomes[0])),
                 format(efficiency_ratio(outcomes[0], outcomes[2])), format(time_ratio(outcomes[2], outcomes[0])));
      std::fflush(stdout);
    }
  } catch (const std::exception& error) {
    fmt::print(stderr, "kernels: {}\n", error.what());
    return 1;
  }
  return 0;
}
