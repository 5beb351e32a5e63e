#include "renderer/selftest/campaign.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace woodcock::selftest {
namespace {

bool below(const Finding& finding, double level) {
  if (!finding.fault.empty()) return true;
  if (finding.comparisons.empty()) return false;
  return worst(finding.comparisons).p < level / static_cast<double>(finding.comparisons.size());
}

}  // namespace

Verdict judge(const Case& c, uint64_t seed, const Effort& effort) {
  Verdict verdict;
  verdict.examined = c;
  verdict.first = examine(c, seed, effort);
  verdict.suspect = below(verdict.first, kSuspectLevel);
  if (!verdict.suspect) return verdict;
  verdict.second = examine(c, hash_combine(seed, 0x616761696eULL), {effort.passes * 4, effort.budget * 4});
  verdict.failed = below(verdict.second, kFailLevel);
  return verdict;
}

namespace {

Verdict judge_numbered(const Case& c, uint64_t seed, uint64_t index, const Effort& effort) {
  Verdict verdict = judge(c, hash_combine(seed, ~index), effort);
  verdict.index = index;
  return verdict;
}

}  // namespace

Verdict judge(uint64_t seed, uint64_t index, Draw what, const Effort& effort) {
  return judge_numbered(random_case(seed, index, what), seed, index, effort);
}

Verdict judge(uint64_t seed, uint64_t index, Relation relation, const Effort& effort) {
  return judge_numbered(random_case(seed, index, relation), seed, index, effort);
}

std::string report(const Verdict& verdict, const Case& shrunk, uint64_t seed) {
  const Finding& finding = verdict.second;
  const bool furnace = verdict.examined.relation == Relation::kFurnace;
  std::string text = fmt::format("case {} of seed {}: {}{}\n", verdict.index, seed, name_of(verdict.examined.relation),
                                 verdict.examined.rendering.options() + verdict.examined.change.rendering.options());
  if (!finding.fault.empty()) text += fmt::format("  {}\n", finding.fault);
  if (!finding.comparisons.empty()) {
    const Comparison& c = worst(finding.comparisons);
    text += fmt::format("  {}: off by {:.6g} ± {:.2g} of the mean, {:.1f} standard deviations\n", c.what, c.mean, c.error, std::abs(c.z));
  }
  // The relation is named, since which one a number has depends on what was drawn.
  text += fmt::format("  again: woodcock selftest --seed {} --case {} --relation \"{}\"\n", seed, verdict.index,
                      name_of(verdict.examined.relation));
  if (furnace) {
    text += fmt::format("  the smallest scene found; woodcock render{} should make every pixel {:.6g}:\n", shrunk.rendering.options(),
                        furnace_value(shrunk.scene));
  } else {
    text += fmt::format("  the smallest scene found, for woodcock render{}:\n", shrunk.rendering.options());
  }
  text += scene_text(shrunk.scene);
  const std::string other = changed_text(shrunk);
  if (!other.empty()) text += fmt::format("  and what should give the same{}:\n{}", shrunk.change.rendering.options(), other);
  return text;
}

void Tally::add(const Verdict& verdict) {
  ++cases;
  const Finding& finding = verdict.first;
  comparisons += finding.comparisons.size();
  suspects += verdict.suspect ? 1 : 0;
  failures += verdict.failed ? 1 : 0;
  samples += finding.samples;
  const std::vector<std::string> features = features_of(verdict.examined);
  coverage.add(features);
  if (verdict.failed || finding.comparisons.empty()) return;
  largest_z = std::max(largest_z, std::abs(worst(finding.comparisons).z));
  // The means of the whole picture, of all channels.
  if (verdict.examined.relation != Relation::kFurnace) return;
  double mean = 0, error = 0;
  for (size_t i = kComparisons - 3; i < kComparisons; ++i) {
    mean += finding.comparisons[i].mean / 3;
    error += finding.comparisons[i].error / 3;
  }
  if (!(error < 0.03)) return;
  for (const std::string& feature : features) {
    auto& sums = pooled[feature];
    sums[0] += mean;
    sums[1] += error * error;
    sums[2] += 1;
  }
}

std::pair<std::string, double> Tally::worst_pooled() const {
  std::pair<std::string, double> found{"", 0};
  for (const auto& [feature, sums] : pooled) {
    if (!(sums[1] > 0)) continue;
    const double z = sums[0] / std::sqrt(sums[1] + 1e-10 * sums[2] * sums[2]);
    if (std::abs(z) > std::abs(found.second)) found = {feature, z};
  }
  return found;
}

}  // namespace woodcock::selftest
