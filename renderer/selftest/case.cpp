#include "renderer/selftest/case.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <exception>

#include "renderer/selftest/random_draws.h"
#include "renderer/selftest/random_rendering.h"
#include "renderer/selftest/random_scene.h"
#include "renderer/selftest/split_frame.h"
#include "renderer/selftest/visibility.h"

namespace woodcock::selftest {
namespace {

/// What float arithmetic may be off by in a furnace, relative.
constexpr double kRounding = 5e-5;

std::string fault_of(const PathCounters& count) {
  if (count.nonfinite > 0) return fmt::format("{} samples are not finite", count.nonfinite);
  if (count.majorant_violations > 0) return fmt::format("{} look-ups found more than the bound", count.majorant_violations);
  if (count.truncated > 0) return fmt::format("{} paths were cut off", count.truncated);
  return "";
}

void take(const Samples& samples, Finding& finding) {
  finding.counters.add(samples.counters);
  finding.samples += samples.values.size();
  if (finding.fault.empty()) finding.fault = fault_of(samples.counters);
}

void examine_furnace(const Case& c, uint64_t seed, const Effort& effort, Finding& finding) {
  const Samples samples = render_samples(scene_text(c.scene), c.rendering, seed, effort.passes, effort.budget);
  const double expected = furnace_value(c.scene);
  std::vector<DVec3> differences;
  for (const Rgb v : samples.values) differences.push_back(DVec3(v) / expected - DVec3(1));
  finding.comparisons = compare_with_zero(differences, kRounding, rare_size(differences));
  take(samples, finding);
}

bool same_bits(Rgb a, Rgb b) { return std::bit_cast<std::array<uint32_t, 3>>(a) == std::bit_cast<std::array<uint32_t, 3>>(b); }

void compare_bits(const Samples& a, const Samples& b, Finding& finding) {
  size_t different = 0;
  const size_t count = std::min(a.values.size(), b.values.size());
  for (size_t i = 0; i < count; ++i) different += same_bits(a.values[i], b.values[i]) ? 0 : 1;
  finding.comparisons.push_back({});
  finding.comparisons.back().what = "bits of the samples";
  if (different > 0) finding.fault = fmt::format("{} of {} samples have other bits", different, count);
}

/// Both sides are rendered with the same random numbers, and their differences tested: what follows the same paths has hardly any noise.
void examine_relation(const Case& c, uint64_t seed, const Effort& effort, Finding& finding) {
  const Variant one{c.scene, {}, c.rendering};
  const auto other = changed(c.relation, c.change, one);
  if (!other) {
    finding.empty = true;
    return;
  }
  const Samples a = render_samples(scene_text(one.scene, one.writing), one.rendering, seed, effort.passes, effort.budget);
  const Samples b = render_samples(scene_text(other->scene, other->writing), other->rendering, seed, effort.passes, effort.budget);
  take(a, finding);
  take(b, finding);
  if (is_exact(c.relation)) return compare_bits(a, b, finding);
  const size_t count = std::min(a.values.size(), b.values.size());
  double mean = 0;
  std::vector<DVec3> differences(count);
  for (size_t i = 0; i < count; ++i) {
    for (int channel = 0; channel < 3; ++channel) {
      const double x = static_cast<double>(a.values[i][channel]);
      const double y = static_cast<double>(b.values[i][channel_after(c.relation, c.change, channel)]);
      mean += (x + y) / (6 * static_cast<double>(count));
      differences[i][channel] = x - y;
    }
  }
  if (mean > 0)
    for (DVec3& d : differences) d /= mean;
  finding.comparisons = compare_with_zero(differences, tolerance(c.relation), follows_same_paths(c.relation) ? 0 : rare_size(differences));
}

/// Has no noise: one light sample that is seen otherwise fails the case.
void examine_visibility(const Case& c, uint64_t seed, const Effort& effort, Finding& finding) {
  const Placement& placement = c.scene.placement;
  const double mirror = placement.mirrored ? -1 : 1;
  const int points = effort.passes * kEdge * kEdge / 4;
  const VisibilityCount count = compare_visibility(
      scene_text(c.scene), placement.scale, DVec3(mirror * placement.offset.x, placement.offset.y, placement.offset.z), seed, points);
  finding.samples = static_cast<uint64_t>(count.compared);
  finding.empty = count.compared == 0;
  finding.comparisons.push_back({});
  finding.comparisons.back().what = "light samples seen";
  if (count.different > 0)
    finding.fault = fmt::format("{} of {} light samples are seen otherwise than by a ray", count.different, count.compared);
}

/// Whether a relation that compares two renderings says something of this scene.
bool applies(const Case& c) {
  if (c.relation == Relation::kSplit) return true;
  if (c.relation == Relation::kVisibility)
    return std::any_of(c.scene.bodies.begin(), c.scene.bodies.end(), [](const Body& b) { return b.emission != DVec3(0) && !b.instance; });
  return changed(c.relation, c.change, {c.scene, {}, c.rendering}).has_value();
}

}  // namespace

Case random_case(uint64_t seed, uint64_t index, Relation relation) {
  RandomDraws draw(hash_combine(hash_combine(seed, index), static_cast<uint64_t>(relation)));
  Case c;
  c.relation = relation;
  if (relation == Relation::kFurnace) {
    c.scene = random_furnace(draw);
    c.rendering = random_rendering(draw, c.scene);
    return c;
  }
  // Until one of the scenes is one that the relation says something of.
  for (int attempt = 0; attempt < 300; ++attempt) {
    c.scene = random_scene_for(relation, draw);
    c.change = random_change(draw, relation, c.scene);
    if (applies(c)) break;
  }
  return c;
}

Case random_case(uint64_t seed, uint64_t index, Draw what) {
  RandomDraws draw(hash_combine(seed, index));
  // Both are drawn, so that a case has one number whatever else is asked for.
  const bool furnace = draw.chance(2.0 / 3);
  const auto relation = static_cast<Relation>(1 + draw.index(kRelationCount - 1));
  return random_case(seed, index, what == Draw::kFurnaces || (what == Draw::kBoth && furnace) ? Relation::kFurnace : relation);
}

Finding examine(const Case& c, uint64_t seed, const Effort& effort) {
  Finding finding;
  try {
    if (c.relation == Relation::kFurnace) {
      examine_furnace(c, seed, effort, finding);
    } else if (c.relation == Relation::kSplit) {
      finding.comparisons.push_back({});
      finding.comparisons.back().what = "bits of the pixels";
      finding.fault = compare_split(scene_text(c.scene), seed, c.change.choice);
      finding.samples = kEdge * kEdge * kSplitSamples * 2;
    } else if (c.relation == Relation::kVisibility) {
      examine_visibility(c, seed, effort, finding);
    } else {
      examine_relation(c, seed, effort, finding);
    }
  } catch (const std::exception& error) {
    finding.fault = error.what();
  }
  return finding;
}

std::string changed_text(const Case& c) {
  const auto other = changed(c.relation, c.change, {c.scene, {}, c.rendering});
  return other ? scene_text(other->scene, other->writing) : "";
}

}  // namespace woodcock::selftest
