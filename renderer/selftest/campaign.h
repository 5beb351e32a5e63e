// Cases one after the other: what was compared, what came out wrong, and what it shrinks to.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "renderer/selftest/case.h"
#include "renderer/selftest/coverage.h"

namespace woodcock::selftest {

/// A case is suspect where one of its comparisons has p < kSuspectLevel/comparisons. It is examined again with four times the samples
/// and other random numbers, and fails where p < kFailLevel/comparisons there. A right renderer then fails a case with a probability of
/// at most kSuspectLevel · kFailLevel = 1e-8, and one of 10000 cases with 1e-4, as far as Student's t holds for means of pixels.
inline constexpr double kSuspectLevel = 1e-3, kFailLevel = 1e-5;

/// The verdict on one case.
struct Verdict {
  uint64_t index = 0;
  Case examined;
  Finding first;  ///< at the usual effort
  bool suspect = false;
  bool failed = false;
  Finding second;  ///< of a suspect
};

/// Examines case `index` of campaign `seed`.
Verdict judge(uint64_t seed, uint64_t index, Draw what, const Effort& effort);
/// The same of the cases of one relation.
Verdict judge(uint64_t seed, uint64_t index, Relation relation, const Effort& effort);
/// Examines a case; `seed` is that of its random numbers.
Verdict judge(const Case& c, uint64_t seed, const Effort& effort);

/// The smallest case that still fails: parts are taken out and values made simple as long as it does. `try_one` is asked about each
/// attempt and may end the search by returning false.
Case shrink(const Case& c, uint64_t seed, const Effort& effort, const std::function<bool()>& go_on);

/// What to print of a failure: what was found, the scene, and the commands that repeat it.
std::string report(const Verdict& verdict, const Case& shrunk, uint64_t seed);

/// Sums over many cases.
struct Tally {
  uint64_t cases = 0, comparisons = 0, suspects = 0, failures = 0, samples = 0;
  double largest_z = 0;  ///< of all comparisons of cases that did not fail
  Coverage coverage;
  std::map<std::string, std::array<double, 3>> pooled;  ///< by feature: Σ mean, Σ variance, cases

  void add(const Verdict& verdict);
  /// The feature whose cases deviate most in the mean, in standard deviations.
  std::pair<std::string, double> worst_pooled() const;
};

}  // namespace woodcock::selftest
