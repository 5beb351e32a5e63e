#include "renderer/scene/frames.h"

#include <cstdlib>

namespace woodcock {

namespace {
size_t last_mark(const std::string& pattern) {
  const size_t name = pattern.rfind('/') == std::string::npos ? 0 : pattern.rfind('/') + 1;
  const size_t mark = pattern.rfind('#');
  return mark == std::string::npos || mark < name ? std::string::npos : mark;
}
}  // namespace

bool has_frame_number(const std::string& pattern) { return last_mark(pattern) != std::string::npos; }

std::string scene_path_for_frame(const std::string& pattern, int frame) {
  const size_t last = last_mark(pattern);
  if (last == std::string::npos) return pattern;
  size_t first = last;
  while (first > 0 && pattern[first - 1] == '#') --first;
  const std::string digits = std::to_string(std::abs(static_cast<long>(frame)));
  const size_t width = last - first + 1;
  std::string number(frame < 0 ? 1 : 0, '-');
  if (digits.size() < width) number.append(width - digits.size(), '0');
  number += digits;
  return pattern.substr(0, first) + number + pattern.substr(last + 1);
}

}  // namespace woodcock
