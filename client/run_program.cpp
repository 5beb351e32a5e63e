#include "client/run_program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "rpc/child_program.h"
#include "rpc/file_descriptor.h"

namespace woodcock {

namespace fs = std::filesystem;

fs::path find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  const std::string list = path == nullptr ? "" : path;
  for (size_t begin = 0; begin <= list.size();) {
    const size_t end = std::min(list.find(':', begin), list.size());
    const fs::path file = fs::path(list.substr(begin, end - begin)) / name;
    if (::access(file.c_str(), X_OK) == 0) return file;
    begin = end + 1;
  }
  return {};
}

int run_program(const fs::path& program, const std::vector<std::string>& arguments, const fs::path& log) {
  const rpc::FileDescriptor output(::open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (!output) throw std::runtime_error(fmt::format("cannot write {}: {}", log.string(), std::strerror(errno)));
  rpc::ChildStart start{.program = program, .arguments = arguments};
  start.descriptors = {{STDOUT_FILENO, output.get()}, {STDERR_FILENO, output.get()}};
  const int status = rpc::ChildProgram(start).wait();
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

}  // namespace woodcock
