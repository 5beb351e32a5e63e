#include "client/background_program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "rpc/file_descriptor.h"

namespace woodcock {

namespace fs = std::filesystem;

fs::path program_folder() { return fs::read_symlink("/proc/self/exe").parent_path(); }

BackgroundProgram::BackgroundProgram(const std::string& program, const std::vector<std::string>& arguments, const fs::path& log)
    : name_(log.stem()), program_(program), arguments_(arguments), log_(log) {
  start(O_TRUNC);
}

void BackgroundProgram::start_again() {
  started_ = false;
  start(O_APPEND);
}

void BackgroundProgram::start(int log_flags) {
  const std::string path = program_folder() / program_;
  if (::access(path.c_str(), X_OK) != 0)
    throw std::runtime_error(fmt::format("{} is missing: build or install it beside this program", path));
  const rpc::FileDescriptor output(::open(log_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | log_flags, 0644));
  if (!output) throw std::runtime_error(fmt::format("cannot write {}: {}", log_.string(), std::strerror(errno)));
  rpc::ChildStart how{.program = path, .arguments = arguments_};
  how.descriptors = {{STDOUT_FILENO, output.get()}, {STDERR_FILENO, output.get()}};
  how.own_group = true;
  child_ = rpc::ChildProgram(how);
  started_ = true;
}

std::string BackgroundProgram::how_it_ended() {
  if (!started_) return "could not be started";
  const std::optional<int> status = child_.status();
  if (!status) return "still runs";
  if (WIFSIGNALED(*status)) return fmt::format("was ended by {}", ::sigdescr_np(WTERMSIG(*status)));
  return fmt::format("ended with code {}", WEXITSTATUS(*status));
}

void BackgroundProgram::ask_to_end() {
  if (running()) child_.signal(SIGTERM);
}

std::string BackgroundProgram::last_output() const {
  std::ifstream file(log_, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(file)), {});
  const size_t kept = std::min<size_t>(text.size(), 1500);
  return text.substr(text.size() - kept);
}

}  // namespace woodcock
