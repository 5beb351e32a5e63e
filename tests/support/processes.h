// Processes of this machine, as /proc shows them.
#pragma once

#include <sys/types.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

namespace woodcock::testing {

struct ProcessNow {
  char state = '?';
  pid_t parent = 0;
  double cpu_seconds = 0;  ///< its own, and that of its children that have ended
};

/// Nothing where there is no such process.
inline std::optional<ProcessNow> process_now(pid_t process) {
  std::ifstream stat("/proc/" + std::to_string(process) + "/stat");
  std::string line;
  if (!std::getline(stat, line)) return std::nullopt;
  // After the name, which ends with the last bracket: state, parent, eleven numbers, then four times in ticks.
  std::istringstream words(line.substr(line.rfind(')') + 1));
  const std::vector<std::string> fields{std::istream_iterator<std::string>(words), {}};
  if (fields.size() < 15) return std::nullopt;
  ProcessNow now{fields[0][0], static_cast<pid_t>(std::stol(fields[1])), 0};
  for (size_t i = 11; i < 15; ++i) now.cpu_seconds += std::stod(fields[i]) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  return now;
}

inline std::vector<pid_t> children_of(pid_t parent) {
  std::vector<pid_t> children;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const auto now = process_now(static_cast<pid_t>(std::stol(name)));
    if (now && now->parent == parent && now->state != 'Z') children.push_back(static_cast<pid_t>(std::stol(name)));
  }
  return children;
}

}  // namespace woodcock::testing
