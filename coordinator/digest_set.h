// Which digests are in use, in eight bytes each: for a clean-up that looks through all of them.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <string>
#include <vector>

namespace woodcock::coordinator {

/// The first 64 bits of a digest.
inline uint64_t digest_prefix(const std::string& digest) {
  uint64_t bits = 0;
  std::from_chars(digest.data(), digest.data() + std::min<size_t>(16, digest.size()), bits, 16);
  return bits;
}

/// Knows digests by their first 64 bits: it may take one that was never added for one that was (of a million, once in 10^13 questions),
/// never the other way round. Sort it before it is asked.
class DigestSet {
 public:
  void add(const std::string& digest) { prefixes_.push_back(digest_prefix(digest)); }
  void sort() {
    std::sort(prefixes_.begin(), prefixes_.end());
    prefixes_.erase(std::unique(prefixes_.begin(), prefixes_.end()), prefixes_.end());
  }
  bool may_contain(const std::string& digest) const {
    return std::binary_search(prefixes_.begin(), prefixes_.end(), digest_prefix(digest));
  }

 private:
  std::vector<uint64_t> prefixes_;
};

}  // namespace woodcock::coordinator
