// Plays many schedules, or one with its journal.
#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <iostream>
#include <optional>
#include <string>
#include <vector>

#include "tests/service/simulator/simulation.h"
#include "tests/support/temporary_folder.h"

namespace woodcock::simulator {
namespace {

int play_many(const std::vector<Profile>& profiles, uint64_t first, int64_t schedules, const std::filesystem::path& folder) {
  Outcome sum;
  int64_t violations = 0;
  const auto begin = std::chrono::steady_clock::now();
  const auto seconds = [&] { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count(); };
  double told = 0;
  for (int64_t i = 0; i < schedules && violations < 10; ++i) {
    const Profile profile = profiles[static_cast<size_t>(i) % profiles.size()];
    const uint64_t seed = first + static_cast<uint64_t>(i);
    const Outcome outcome = simulate(profile, seed, folder);
    if (outcome.violation) {
      ++violations;
      std::cout << fmt::format("{}\n  {}\n", *outcome.violation, command_for(profile, seed)) << std::flush;
    }
    sum.acknowledged += outcome.acknowledged;
    sum.restarts += outcome.restarts;
    sum.power_cuts += outcome.power_cuts;
    sum.outdated_leaders += outcome.outdated_leaders;
    sum.failed_attempts += outcome.failed_attempts;
    sum.damaged += outcome.damaged;
    sum.crashed_at.insert(outcome.crashed_at.begin(), outcome.crashed_at.end());
    if (seconds() - told < 10 && i + 1 < schedules) continue;
    told = seconds();
    std::cout
        << fmt::format(
               "{} schedules in {:.0f} s ({:.0f} a minute): {} violations; {} results acknowledged, {} starts of the coordinator, {} power "
               "cuts, {} outdated leaders, {} attempts that crashed, {} damaged results, ended at {} failpoints",
               i + 1, told, static_cast<double>(i + 1) / told * 60, violations, sum.acknowledged, sum.restarts, sum.power_cuts,
               sum.outdated_leaders, sum.failed_attempts, sum.damaged, sum.crashed_at.size())
        << std::endl;
  }
  return violations > 0 ? 1 : 0;
}

}  // namespace
}  // namespace woodcock::simulator

int main(int argc, char** argv) {
  using namespace woodcock::simulator;
  CLI::App app("Plays random schedules of faults against the production coordinator, and checks that nothing is lost.");
  std::string name;
  std::optional<uint64_t> seed;
  uint64_t first = 1;
  int64_t schedules = 1000;
  std::vector<std::string> names(kProfileNames.begin(), kProfileNames.end());
  app.add_option("--profile", name, "Which faults; all profiles in turn without it")->check(CLI::IsMember(names));
  app.add_option("--seed", seed, "Play this schedule alone, and write what happens");
  app.add_option("--first", first, "Seed of the first schedule")->capture_default_str();
  app.add_option("--schedules", schedules, "How many")->check(CLI::Range(int64_t{1}, int64_t{1} << 40))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const woodcock::testing::MemoryFolder folder;
  if (seed) {
    const Outcome outcome = simulate(profile_named(name).value_or(Profile::kEverything), *seed, folder.path(), &std::cout);
    std::cout << (outcome.violation ? "violation: " + *outcome.violation : "no violation") << std::endl;
    return outcome.violation ? 1 : 0;
  }
  std::vector<Profile> profiles;
  for (size_t i = 0; i < names.size(); ++i)
    if (name.empty() || names[i] == name) profiles.push_back(static_cast<Profile>(i));
  return play_many(profiles, first, schedules, folder.path());
}
