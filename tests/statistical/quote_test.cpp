// Quotes and what they became: `woodcock quote` against `woodcock render` of as many samples. The samples that the error took are
// those of the render times (its error / the one quoted)², since the two are near each other. They do not depend on the machine's
// other work. CPU times do, so they are compared in bench/quotes.py.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/support/run_command.h"

namespace woodcock {
namespace {

constexpr bool kLong = WOODCOCK_QUOTE_LONG != 0;

nlohmann::json run_json(const std::vector<std::string>& arguments) {
  std::vector<std::string> command{WOODCOCK_BIN_DIR "/woodcock"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  command.insert(command.end(), {"--resolution", "64x48", "--json"});
  const auto result = testing::run_command(command);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  return nlohmann::json::parse(result.out, nullptr, false);
}

TEST(Quotes, HoldOrSayThatTheyMayNot) {
  const testing::TemporaryFolder folder;
  std::vector<std::string> scenes{"fig02", "fig10"}, errors{"5%"};
  if (kLong) {
    scenes = {"fig01", "fig02", "fig03", "fig06", "fig09", "fig10"};
    errors = {"5%", "2%", "1%"};
  }
  int cases = 0, held = 0, wrong = 0;
  for (const std::string& name : scenes)
    for (const std::string& error : errors) {
      const std::string scene = WOODCOCK_SOURCE_DIR "/scenes/paper/" + name + ".pbrt";
      const auto quote = run_json({"quote", scene, "--error", error});
      const auto samples = quote["samples"].get<int64_t>();
      const auto render = run_json({"render", scene, "-o", (folder / "out.exr").string(), "--spp", std::to_string(samples)});
      const double reached = render["error"]["relative_error"], asked = quote["relative_error"];
      const double needed = static_cast<double>(samples) * reached * reached / (asked * asked);
      const double samples_off = needed / static_cast<double>(samples) - 1;
      const bool good = std::abs(samples_off) <= 0.1;
      const std::string doubt = quote["uncertain"];
      ++cases;
      held += good;
      wrong += !good && doubt.empty();
      fmt::print("{} {:>3}: quoted {} ({} to {}) samples, needed {:.0f} ({:+.1f} %){}{}\n", name, error, samples,
                 quote["samples_interval"][0].get<int64_t>(), quote["samples_interval"][1].get<int64_t>(), needed, 100 * samples_off,
                 doubt.empty() ? "" : "; uncertain: ", doubt);
      // Outside of three times the interval something is broken.
      const double width = std::max(quote["samples_interval"][1].get<double>() / static_cast<double>(samples) - 1, 0.05);
      if (doubt.empty()) {
        EXPECT_LE(std::abs(samples_off), 3 * width) << name << " " << error;
      }
    }
  fmt::print("{} of {} quotes held; {} did not and had not said so\n", held, cases, wrong);
  if (kLong) {
    EXPECT_GE(held, 0.8 * cases);
  }
}

}  // namespace
}  // namespace woodcock
