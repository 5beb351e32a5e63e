// What the cases of a campaign contained: how often each feature, and each pair of features.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "renderer/selftest/case.h"

namespace woodcock::selftest {

class Coverage {
 public:
  /// Counts a case once for each of its features and pairs of features.
  void add(const std::vector<std::string>& features);

  const std::map<std::string, int64_t>& features() const { return features_; }
  int64_t pair(const std::string& a, const std::string& b) const;
  /// Pairs that some case had, and pairs that there are of the features seen.
  int64_t pairs_covered() const { return static_cast<int64_t>(pairs_.size()); }
  int64_t pairs_possible() const;

  const std::map<std::pair<std::string, std::string>, int64_t>& pairs() const { return pairs_; }

  /// Features with their counts and how many others each was together with; then, for each two groups (what stands before the slash),
  /// how many of the pairs between them were covered, and how often the median pair was.
  std::string table() const;

 private:
  std::map<std::string, int64_t> features_;
  std::map<std::pair<std::string, std::string>, int64_t> pairs_;
};

}  // namespace woodcock::selftest
