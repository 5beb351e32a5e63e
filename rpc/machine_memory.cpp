#include "rpc/machine_memory.h"

#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>

namespace woodcock::rpc {
namespace {

constexpr const char* kControlGroups = "/sys/fs/cgroup";

/// The least `memory.max` on the way from this process's group up; 0 where there is none. Version 2 only: "0::/path".
int64_t group_limit() {
  std::string group;
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);)
    if (line.starts_with("0::")) group = line.substr(3);
  int64_t least = 0;
  for (;;) {
    int64_t limit = 0;
    // "max" is no number.
    if (std::ifstream(kControlGroups + group + "/memory.max") >> limit && limit > 0) least = least > 0 ? std::min(least, limit) : limit;
    if (group.empty() || group == "/") return least;
    group.erase(group.rfind('/'));
  }
}

}  // namespace

int64_t machine_memory() {
  const int64_t pages = ::sysconf(_SC_PHYS_PAGES), size = ::sysconf(_SC_PAGESIZE);
  const int64_t machine = pages > 0 && size > 0 ? pages * size : 0, limit = group_limit();
  return limit > 0 && (machine == 0 || limit < machine) ? limit : machine;
}

}  // namespace woodcock::rpc
