// What a render child printed during one attempt.
#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>

namespace woodcock {

/// A file with the first `limit` bytes of the output; the last kTail bytes are kept as well and appended at
/// the end, with a line that says how much lies between.
class AttemptLog {
 public:
  static constexpr size_t kTail = 4096;
  /// An empty path keeps the tail only.
  AttemptLog(const std::string& path, uint64_t limit);
  ~AttemptLog();
  AttemptLog(const AttemptLog&) = delete;
  AttemptLog& operator=(const AttemptLog&) = delete;

  void append(std::string_view text);
  /// The last lines, for a failure report.
  const std::string& tail() const { return tail_; }

 private:
  std::ofstream file_;
  uint64_t limit_;
  uint64_t written_ = 0;
  uint64_t total_ = 0;
  std::string tail_;
};

}  // namespace woodcock
