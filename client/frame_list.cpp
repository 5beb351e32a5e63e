#include "client/frame_list.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <set>
#include <stdexcept>

#include "rpc/limits.h"
#include "rpc/printable.h"

namespace woodcock {
namespace {

/// The text, and how far it is read.
class Reader {
 public:
  explicit Reader(const std::string& text) : text_(text) {}

  bool at_end() const { return at_ == text_.size(); }
  size_t at() const { return at_; }
  bool take(char c) {
    if (at_end() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  uint64_t number(const char* expected) {
    uint64_t value = 0;
    const char* begin = text_.data() + at_;
    const auto [end, error] = std::from_chars(begin, text_.data() + text_.size(), value);
    if (error == std::errc::result_out_of_range) fail(at_, "a number below 2^64");
    if (error != std::errc()) fail(at_, expected);
    at_ += static_cast<size_t>(end - begin);
    return value;
  }
  /// `place`: index of the first character that is not as expected.
  [[noreturn]] void fail(size_t place, const std::string& expected) const {
    constexpr size_t kShown = 20;
    std::string found = "the end";
    if (place < text_.size()) found = fmt::format("\"{}\"", rpc::printable(text_.substr(place, std::min(kShown, text_.size() - place))));
    throw std::invalid_argument(
        fmt::format("found {} at character {} of \"{}\", expected {}", found, place + 1, rpc::printable(text_.substr(0, 200)), expected));
  }

 private:
  const std::string& text_;
  size_t at_ = 0;
};

}  // namespace

FrameList parse_frame_list(const std::string& text) {
  FrameList list;
  std::set<uint64_t> seen, repeated;
  uint64_t listed = 0;
  Reader reader(text);
  do {
    const size_t place = reader.at();
    const uint64_t first = reader.number("a frame, e.g. 7, or a range, e.g. 1-100 or 1-100x5");
    uint64_t last = first, step = 1;
    if (reader.take('-')) {
      const size_t last_place = reader.at();
      last = reader.number("the last frame of the range, e.g. 1-100");
      if (last < first) reader.fail(last_place, fmt::format("a last frame that is not before {}", first));
      if (reader.take('x')) {
        const size_t step_place = reader.at();
        step = reader.number("the step of the range, e.g. 1-100x5");
        if (step == 0) reader.fail(step_place, "a step of at least 1");
      }
    }
    // Counted before anything is made of it.
    const uint64_t more = (last - first) / step;
    if (more >= rpc::kMaxFramesPerJob || listed + more + 1 > rpc::kMaxFramesPerJob)
      reader.fail(place, fmt::format("at most {} frames in all", rpc::kMaxFramesPerJob));
    listed += more + 1;
    for (uint64_t i = 0; i <= more; ++i) {
      const uint64_t frame = first + i * step;
      if (seen.insert(frame).second)
        list.frames.push_back(frame);
      else if (repeated.insert(frame).second)
        list.repeated.push_back(frame);
    }
    if (!reader.at_end() && !reader.take(',')) reader.fail(reader.at(), "\",\" or the end, or \"-\" or \"x\" of a range such as 1-100x5");
    if (reader.at_end() && !text.empty() && text.back() == ',') reader.fail(reader.at(), "a frame or a range after the comma");
  } while (!reader.at_end());
  return list;
}

std::string describe_frames(std::vector<uint64_t> frames, size_t limit) {
  std::sort(frames.begin(), frames.end());
  std::string text;
  size_t written = 0;
  for (size_t i = 0; i < frames.size(); ++written) {
    size_t end = i + 1;
    while (end < frames.size() && frames[end] == frames[end - 1] + 1) ++end;
    if (written > 0) text += ", ";
    if (written == limit) return text + "…";
    text += end - i > 1 ? fmt::format("{}-{}", frames[i], frames[end - 1]) : std::to_string(frames[i]);
    i = end;
  }
  return text;
}

}  // namespace woodcock
