// The reference cases: scenes whose exact radiance is known, with the source of each value.
#pragma once

#include <map>
#include <string>
#include <vector>

namespace woodcock::reference {

struct Case {
  std::string id, what, source;
  std::map<std::string, double> parameters;  ///< the numeric ones
  /// The exact values by name: "R" and "T" of a slab, or one value with an empty name.
  std::map<std::string, double> expected;
  double uncertainty = 0;  ///< of each value, absolute

  /// The parameter, or `otherwise` when the case does not give it.
  double get(const std::string& name, double otherwise) const;
  /// The parameter. Throws std::out_of_range when the case does not give it.
  double get(const std::string& name) const;
};

/// Reads a list of cases in the format of cases.json. Throws std::runtime_error.
std::vector<Case> read_cases(const std::string& path);

}  // namespace woodcock::reference
