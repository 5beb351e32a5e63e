#include "worker/attempt_log.h"

#include <algorithm>

namespace woodcock {

AttemptLog::AttemptLog(const std::string& path, uint64_t limit) : limit_(limit) {
  if (!path.empty()) file_.open(path, std::ios::binary | std::ios::trunc);
}

AttemptLog::~AttemptLog() {
  if (total_ == written_) return;
  const uint64_t at_end = std::min<uint64_t>(tail_.size(), total_ - written_);
  if (const uint64_t left_out = total_ - written_ - at_end; left_out > 0) file_ << "\n[" << left_out << " bytes left out]\n";
  file_ << tail_.substr(tail_.size() - at_end);
}

void AttemptLog::append(std::string_view text) {
  const uint64_t fits = std::min<uint64_t>(text.size(), limit_ - written_);
  file_.write(text.data(), static_cast<std::streamsize>(fits));
  written_ += fits;
  total_ += text.size();
  tail_.append(text.substr(text.size() - std::min(text.size(), kTail)));
  if (tail_.size() > kTail) tail_.erase(0, tail_.size() - kTail);
}

}  // namespace woodcock
