// `woodcock estimators`: every way in which light can be computed along a ray.
#include "renderer/transport/estimator.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/print.h"

namespace woodcock {
namespace {

/// The options that an estimator takes beyond those of every render.
std::vector<std::string> options_of(const EstimatorInfo& e) {
  std::vector<std::string> options;
  if (e.step) options.push_back("--step");
  if (e.takes_directions()) options.push_back("--directions");
  if (e.branching) options.push_back("--branching");
  if (e.tunable) options.insert(options.end(), {"--kernel", "--plan", "--without"});
  return options;
}

void print_json() {
  nlohmann::json j{{"estimators", nlohmann::json::array()}, {"features", nlohmann::json::array()}};
  for (const EstimatorInfo& e : estimators()) {
    nlohmann::json entry{{"name", e.name},
                         {"summary", e.summary},
                         {"formula", e.formula},
                         {"source", e.source},
                         {"biased", e.biased()},
                         {"samples_lights", e.samples_lights},
                         {"media_scatter", e.media_scatter},
                         {"options", options_of(e)}};
    if (e.biased()) entry["bias"] = e.bias;
    if (e.takes_directions()) entry["directions"] = e.directions;
    j["estimators"].push_back(entry);
  }
  for (const FeatureInfo& f : kFeatures) j["features"].push_back({{"name", f.name}, {"meaning", f.meaning}});
  say_json(j);
}

void print_text() {
  for (const EstimatorInfo& e : estimators()) {
    say("{}: {}\n", e.name, e.summary);
    say("  {}\n  source: {}\n", e.formula, e.source);
    say("  {}\n", e.biased() ? fmt::format("biased: {}", e.bias) : "unbiased");
    if (!e.media_scatter) say("  refuses media that scatter\n");
    if (!e.samples_lights) say("  refuses point, spot and distant lights, since it does not sample lights\n");
    if (e.takes_directions()) say("  --directions: {}\n", e.directions);
    if (const auto options = options_of(e); !options.empty()) say("  takes {}\n", fmt::join(options, ", "));
    say("\n");
  }
  say("features of auto, for --without:\n");
  for (const FeatureInfo& f : kFeatures) say("  {:<20} {}\n", f.name, f.meaning);
}

}  // namespace

void add_estimators_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("estimators", "List the ways of computing light along a ray, with formula, source and bias");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "One JSON object on standard output, nothing else there");
  command->footer("Example:\n  woodcock estimators --json");
  command->callback([json, &code] {
    *json ? print_json() : print_text();
    code = 0;
  });
}

}  // namespace woodcock
