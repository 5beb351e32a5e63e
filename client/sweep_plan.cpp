#include "client/sweep_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <stdexcept>

#include "client/frame_options.h"
#include "renderer/frame/estimator_settings.h"
#include "renderer/scene/parameter_edits.h"
#include "renderer/transport/features.h"

namespace woodcock {
namespace {

/// The seed of references lies far from those of curves.
constexpr uint64_t kReferenceSeed = uint64_t{1} << 62;

/// A name as a part of a file name.
std::string file_word(const std::string& name) {
  std::string word;
  for (const char c : name) word += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '.' || c == '_' ? c : '-';
  return word.substr(0, 80);
}

/// The values of an option, or one absent value where it is not given or not taken.
template <typename T>
std::vector<std::optional<T>> choices(const std::vector<T>& values, bool taken) {
  if (!taken || values.empty()) return {std::nullopt};
  return {values.begin(), values.end()};
}

template <typename T>
void refuse_twice(const std::vector<T>& values, const char* option) {
  for (size_t i = 0; i < values.size(); ++i)
    if (std::find(values.begin(), values.begin() + static_cast<ptrdiff_t>(i), values[i]) != values.begin() + static_cast<ptrdiff_t>(i))
      throw std::invalid_argument(fmt::format("{}: found a value twice, expected each once", option));
}

/// Throws where no estimator of the sweep takes the option.
void refuse_unused(const SweepOptions& options, bool given, const char* option, bool (*takes)(const EstimatorInfo&)) {
  if (!given) return;
  for (const std::string& name : options.estimators)
    if (const EstimatorInfo* e = find_estimator(name); e != nullptr && takes(*e)) return;
  throw std::invalid_argument(fmt::format("{}: none of the estimators takes it; expected one of {}", option, estimator_names(takes)));
}

/// The settings of one estimator: what all share, without what it does not take.
FrameSettings settings_of(const SweepOptions& options, const EstimatorInfo& estimator) {
  FrameSettings settings = options.settings;
  settings.estimator = estimator.name;
  settings.aovs = "none";
  if (!estimator.takes_directions()) settings.directions.reset();
  if (!estimator.branching) settings.branching.reset();
  return settings;
}

/// Every choice of one value of each "path=value,value", as texts of `--set`. One choice, the empty one, where nothing is set.
std::vector<std::vector<std::string>> choices_of_sets(const std::vector<std::string>& sets) {
  std::vector<std::vector<std::string>> all{{}};
  for (const std::string& set : sets) {
    if (set.rfind("integrator.", 0) == 0)
      throw std::invalid_argument(fmt::format("set: found \"{}\", expected --max-depth for it: depths share a reference", set));
    const size_t equals = std::min(set.find('='), set.size());
    std::vector<std::vector<std::string>> longer;
    for (size_t begin = equals + 1; begin <= set.size();) {
      const size_t end = std::min(set.find(',', begin), set.size());
      const ParameterEdit edit = parse_edit(set.substr(0, equals + 1) + set.substr(begin, end - begin));
      for (std::vector<std::string> choice : all) {
        choice.push_back(edit.text());
        longer.push_back(choice);
      }
      begin = end + 1;
    }
    all = longer;
    if (all.empty()) parse_edit(set);
    if (all.size() > kMaxCurves)
      throw std::invalid_argument(fmt::format("set: found {} combinations, expected at most {}", all.size(), kMaxCurves));
  }
  for (const auto& choice : all) ParameterEdits{choice};
  refuse_twice(all, "set");
  return all;
}

void add_curves(const SweepOptions& options, size_t group, int deepest, SweepPlan& plan) {
  for (const std::string& name : options.estimators) {
    const EstimatorInfo* estimator = find_estimator(name);
    if (estimator == nullptr)
      throw std::invalid_argument(fmt::format("estimators: found \"{}\", expected any of: {}", name, estimator_names()));
    for (const auto& step : choices(options.steps, estimator->step)) {
      for (const auto& depth : choices(options.depths, true)) {
        SweepCurve curve{"", name, estimator->bias, settings_of(options, *estimator), group};
        curve.settings.step = step;
        curve.settings.set = plan.groups[group].reference.set;
        if (step) curve.name += fmt::format(", step {}", *step);
        if (depth) {
          curve.settings.max_depth = *depth;
          curve.name += fmt::format(", depth {}", *depth);
          if (*depth < deepest)
            curve.bias += fmt::format("{}paths end after {} scatterings, those of the reference after {}", curve.bias.empty() ? "" : "; ",
                                      *depth, deepest);
        }
        resolve_estimator(curve.settings);
        if (plan.groups.size() > 1) curve.name += ", " + plan.groups[group].setting;
        curve.id = fmt::format("{:02}-{}", plan.curves.size(), file_word(curve.name));
        plan.curves.push_back(curve);
      }
    }
  }
}

void add_effects(const SweepOptions& options, SweepPlan& plan) {
  FrameSettings all = settings_of(options, *find_estimator("auto"));
  all.set = plan.groups.front().reference.set;
  const auto add = [&](const std::string& left_out, bool changes_picture, const FrameSettings& settings) {
    plan.effects.push_back({fmt::format("effect-{:02}-{}", plan.effects.size(), file_word(left_out.empty() ? "all" : left_out)), left_out,
                            changes_picture, settings});
  };
  add("", false, all);
  for (const FeatureInfo& feature : kFeatures) {
    FrameSettings settings = all;
    settings.without = feature.name;
    add(fmt::format("{} ({})", feature.name, feature.meaning), false, settings);
  }
  FrameSettings general = all;
  general.plan = false;
  add("the plan (--plan off)", false, general);
  FrameSettings full = all;
  full.full_kernel = true;
  // The kernel is no part of a result's identity: workers would not render it again.
  if (!options.by_workers) add("the scene's own kernel (--kernel full)", false, full);
  const TransferTerms terms = parse_terms(all.only);
  for (const auto member :
       {&TransferTerms::absorption, &TransferTerms::emission, &TransferTerms::out_scattering, &TransferTerms::in_scattering}) {
    TransferTerms rest = terms, left_out{false, false, false, false};
    if (!(terms.*member)) continue;
    rest.*member = false;
    left_out.*member = true;
    FrameSettings settings = all;
    settings.only = to_string(rest);
    if (!settings.only.empty()) add(to_string(left_out), true, settings);
  }
}

}  // namespace

SweepPlan plan_sweep(const SweepOptions& options, int scene_depth, uint64_t scene_seed) {
  refuse_twice(options.estimators, "estimators");
  refuse_twice(options.steps, "step");
  refuse_twice(options.depths, "max-depth");
  refuse_unused(options, !options.steps.empty(), "step", [](const EstimatorInfo& e) { return e.step; });
  refuse_unused(options, options.settings.directions.has_value(), "directions",
                [](const EstimatorInfo& e) { return e.takes_directions(); });
  refuse_unused(options, options.settings.branching.has_value(), "branching", [](const EstimatorInfo& e) { return e.branching; });
  SweepPlan plan;
  plan.counts = options.counts;
  plan.seeds = static_cast<size_t>(options.seeds);
  plan.first_seed = options.settings.seed.value_or(scene_seed);
  const int deepest =
      options.depths.empty() ? scene_depth : std::max(scene_depth, *std::max_element(options.depths.begin(), options.depths.end()));
  for (const std::vector<std::string>& choice : choices_of_sets(options.sets)) {
    SweepGroup group{fmt::format("{}", fmt::join(choice, ", ")), settings_of(options, *find_estimator("auto"))};
    group.reference.seed = plan.first_seed ^ kReferenceSeed;
    group.reference.max_depth = deepest;
    group.reference.set = choice;
    plan.groups.push_back(group);
  }
  if (plan.groups.size() > 1 && !options.reference.empty())
    throw std::invalid_argument(
        "reference: found one with several values of --set, which show different pictures; leave it out, and one is made for each");
  for (size_t group = 0; group < plan.groups.size(); ++group) add_curves(options, group, deepest, plan);
  if (plan.curves.size() > kMaxCurves)
    throw std::invalid_argument(
        fmt::format("found {} curves (estimators times values), expected at most {}", plan.curves.size(), kMaxCurves));
  if (options.reference.empty())
    plan.reference_samples = options.reference_samples > 0 ? options.reference_samples : kReferenceFactor * plan.counts.back();
  if (options.effects) {
    plan.effect_samples = std::min(plan.counts.back(), kEffectSamples);
    add_effects(options, plan);
  }
  return plan;
}

nlohmann::json describe_plan(const SweepPlan& plan) {
  nlohmann::json j{{"samples", plan.counts},
                   {"seeds", plan.seeds},
                   {"first seed", plan.first_seed},
                   {"samples of the reference", plan.reference_samples}};
  for (const SweepCurve& curve : plan.curves) j["curves"].push_back(curve.id + options_of(curve.settings));
  for (const SweepGroup& group : plan.groups) j["references"].push_back("reference" + options_of(group.reference));
  j["effects"] = nlohmann::json::array();
  for (const SweepEffect& effect : plan.effects) j["effects"].push_back(effect.id);
  const auto& crop = plan.curves.front().settings.crop;
  j["crop"] = crop ? nlohmann::json(*crop) : nlohmann::json();
  return j;
}

}  // namespace woodcock
