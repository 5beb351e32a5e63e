// Plays many schedules, or one with its journal.
#include <CLI/CLI.hpp>

#include <cstdint>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "tests/service/simulator/many.h"
#include "tests/service/simulator/simulation.h"
#include "tests/support/temporary_folder.h"

int main(int argc, char** argv) {
  using namespace woodcock::simulator;
  CLI::App app("Plays random schedules of faults against the production coordinator, and checks that nothing is lost.");
  std::string name;
  std::optional<uint64_t> seed;
  ManyOptions many;
  std::vector<std::string> names(kProfileNames.begin(), kProfileNames.end());
  app.add_option("--profile", name, "Which faults; all profiles in turn without it")->check(CLI::IsMember(names));
  app.add_option("--seed", seed, "Play this schedule alone, and write what happens");
  app.add_option("--first", many.first, "Seed of the first schedule")->capture_default_str();
  app.add_option("--schedules", many.schedules, "How many")->check(CLI::Range(int64_t{1}, int64_t{1} << 40))->capture_default_str();
  app.add_option("--jobs", many.processes, "Processes that play them at once")->check(CLI::Range(1, 1024))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const woodcock::testing::MemoryFolder folder;
  if (seed) {
    const Outcome outcome = simulate(profile_named(name).value_or(Profile::kEverything), *seed, folder.path(), &std::cout);
    std::cout << (outcome.violation ? "violation: " + *outcome.violation : "no violation") << std::endl;
    return outcome.violation ? 1 : 0;
  }
  for (size_t i = 0; i < names.size(); ++i)
    if (name.empty() || names[i] == name) many.profiles.push_back(static_cast<Profile>(i));
  const Many played = play_many(many, folder.path(), std::cout);
  std::cout << describe(played) << std::endl;
  return played.violations.empty() ? 0 : 1;
}
