#include "renderer/frame/estimator_settings.h"

#include <fmt/format.h>

#include <cmath>
#include <stdexcept>

namespace woodcock {
namespace {

[[noreturn]] void refuse(const std::string& message) { throw std::invalid_argument(message); }

/// The parts of "a,b,c", each passed to `take`.
template <typename Take>
void for_each_word(std::string_view list, Take&& take) {
  while (true) {
    const size_t comma = list.find(',');
    take(list.substr(0, comma));
    if (comma == std::string_view::npos) return;
    list.remove_prefix(comma + 1);
  }
}

constexpr std::pair<const char*, bool TransferTerms::*> kTerms[] = {{"absorption", &TransferTerms::absorption},
                                                                    {"emission", &TransferTerms::emission},
                                                                    {"out-scattering", &TransferTerms::out_scattering},
                                                                    {"in-scattering", &TransferTerms::in_scattering}};

/// Appends a word to a list.
void append(std::string& list, const char* separator, const char* word) {
  if (!list.empty()) list += separator;
  list += word;
}

std::string feature_names() {
  std::string names;
  for (const FeatureInfo& f : kFeatures) append(names, ", ", f.name);
  return names;
}

/// Refuses an option that the estimator does not take.
void check_taken(bool given, bool taken, const char* option, const EstimatorInfo& estimator, bool (*accepts)(const EstimatorInfo&)) {
  if (!given || taken) return;
  refuse(fmt::format("{}: found it with the estimator \"{}\", which does not take it; expected one of: {}", option, estimator.name,
                     estimator_names(accepts)));
}

int checked_count(std::optional<int> value, const char* option) {
  if (!value) return 1;
  if (*value < 1 || *value > kMaxDirections) refuse(fmt::format("{}: found {}, expected 1 to {}", option, *value, kMaxDirections));
  return *value;
}

}  // namespace

TransferTerms parse_terms(std::string_view list) {
  if (list.empty()) return {};
  TransferTerms terms{false, false, false, false};
  for_each_word(list, [&](std::string_view word) {
    for (const auto& [name, member] : kTerms) {
      if (word != name) continue;
      if (terms.*member) refuse(fmt::format("only: found \"{}\" twice, expected each term once", word));
      terms.*member = true;
      return;
    }
    refuse(
        fmt::format("only: found \"{}\", expected any of absorption, emission, out-scattering, in-scattering, separated by commas", word));
  });
  return terms;
}

std::string to_string(const TransferTerms& terms) {
  std::string list;
  for (const auto& [name, member] : kTerms)
    if (terms.*member) append(list, ",", name);
  return list;
}

Features parse_without(std::string_view list) {
  Features features;
  if (list.empty()) return features;
  for_each_word(list, [&](std::string_view word) {
    for (const FeatureInfo& f : kFeatures) {
      if (word != f.name) continue;
      if (!features.has(f.feature)) refuse(fmt::format("without: found \"{}\" twice, expected each feature once", word));
      features.take_out(f.feature);
      return;
    }
    refuse(fmt::format("without: found \"{}\", expected any of {}, separated by commas", word, feature_names()));
  });
  return features;
}

std::string features_off(const Features& features) {
  std::string list;
  for (const FeatureInfo& f : kFeatures)
    if (!features.has(f.feature)) append(list, ",", f.name);
  return list;
}

EstimatorSettings resolve_estimator(const FrameSettings& settings) {
  EstimatorSettings result;
  result.estimator = find_estimator(settings.estimator);
  if (result.estimator == nullptr)
    refuse(fmt::format("estimator: found \"{}\", expected one of: {}", settings.estimator, estimator_names()));
  const EstimatorInfo& e = *result.estimator;
  check_taken(settings.step.has_value(), e.step, "step", e, [](const EstimatorInfo& i) { return i.step; });
  check_taken(settings.directions.has_value(), e.takes_directions(), "directions", e,
              [](const EstimatorInfo& i) { return i.takes_directions(); });
  check_taken(settings.branching.has_value(), e.branching, "branching", e, [](const EstimatorInfo& i) { return i.branching; });
  const auto tunable = [](const EstimatorInfo& i) { return i.tunable; };
  check_taken(!settings.without.empty(), e.tunable, "without", e, tunable);
  check_taken(!settings.plan, e.tunable, "plan off", e, tunable);
  check_taken(settings.full_kernel, e.tunable, "kernel full", e, tunable);
  if (e.step) {
    if (!settings.step) refuse(fmt::format("step: the estimator \"{}\" marches and needs the length of its steps, in world units", e.name));
    if (!(*settings.step > 0) || !std::isfinite(*settings.step))
      refuse(fmt::format("step: found {}, expected a positive length in world units", *settings.step));
    result.step = *settings.step;
  }
  result.directions = checked_count(settings.directions, "directions");
  result.branching = checked_count(settings.branching, "branching");
  result.terms = parse_terms(settings.only);
  result.features = parse_without(settings.without);
  return result;
}

std::vector<std::pair<std::string, std::string>> estimator_fields(const FrameSettings& settings) {
  const EstimatorSettings s = resolve_estimator(settings);
  const EstimatorInfo& e = *s.estimator;
  std::vector<std::pair<std::string, std::string>> fields{{"estimator", e.name}, {"biased", e.biased() ? "yes" : "no"}};
  if (e.biased()) fields.emplace_back("bias", e.bias);
  fields.emplace_back("terms", to_string(s.terms));
  if (e.step) fields.emplace_back("step", fmt::format("{}", s.step));
  if (e.takes_directions()) fields.emplace_back("directions", std::to_string(s.directions));
  if (e.branching) fields.emplace_back("branching", std::to_string(s.branching));
  if (!settings.plan) fields.emplace_back("plan", "off");
  if (!s.features.all()) fields.emplace_back("without", features_off(s.features));
  return fields;
}

std::vector<std::string> setting_warnings(const SceneDescription& scene) {
  std::vector<std::string> warnings;
  if (const TransferTerms& t = scene.settings.terms; t.in_scattering && !t.out_scattering)
    warnings.push_back(fmt::format(
        "in-scattering without out-scattering: every scattering in a medium gains energy, so the picture depends on the depth limit ({})",
        scene.settings.max_depth));
  return warnings;
}

}  // namespace woodcock
