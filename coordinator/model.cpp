#include "coordinator/model.h"

#include <charconv>

namespace woodcock::coordinator {

std::string to_string(const TaskRef& task) { return task.job + "." + std::to_string(task.frame) + "." + std::to_string(task.number); }

std::optional<TaskRef> parse_task_id(const std::string& id) {
  const size_t second = id.rfind('.');
  if (second == std::string::npos || second == 0) return std::nullopt;
  const size_t first = id.rfind('.', second - 1);
  if (first == std::string::npos || first == 0) return std::nullopt;
  TaskRef task{id.substr(0, first), 0, 0};
  const auto number = [&](size_t begin, size_t end, auto& value) {
    const auto [p, error] = std::from_chars(id.data() + begin, id.data() + end, value);
    return error == std::errc() && p == id.data() + end && value >= 0;
  };
  if (!number(first + 1, second, task.frame) || !number(second + 1, id.size(), task.number)) return std::nullopt;
  return task;
}

const char* to_string(JobState state) {
  static constexpr const char* kNames[] = {"queued", "running", "paused", "assembling", "done", "partial", "failed", "cancelled"};
  return kNames[static_cast<int>(state)];
}

const char* to_string(FrameState state) {
  static constexpr const char* kNames[] = {"queued", "running", "assembling", "done", "partial", "failed", "cancelled"};
  return kNames[static_cast<int>(state)];
}

}  // namespace woodcock::coordinator
