#include "client/background_program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace woodcock {

namespace fs = std::filesystem;

fs::path program_folder() { return fs::read_symlink("/proc/self/exe").parent_path(); }

BackgroundProgram::BackgroundProgram(const std::string& program, const std::vector<std::string>& arguments, const fs::path& log)
    : name_(log.stem()), program_(program), arguments_(arguments), log_(log) {
  start(O_TRUNC);
}

void BackgroundProgram::start_again() {
  status_.reset();
  pid_ = -1;
  start(O_APPEND);
}

void BackgroundProgram::start(int log_flags) {
  const std::string path = program_folder() / program_;
  if (::access(path.c_str(), X_OK) != 0)
    throw std::runtime_error(fmt::format("{} is missing: build or install it beside this program", path));
  const int output = ::open(log_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | log_flags, 0644);
  if (output < 0) throw std::runtime_error(fmt::format("cannot write {}: {}", log_.string(), std::strerror(errno)));
  std::vector<std::string> words{path};
  words.insert(words.end(), arguments_.begin(), arguments_.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  const pid_t parent = ::getpid();
  pid_ = ::fork();
  if (pid_ == 0) {
    // Async-signal-safe calls only.
    ::setpgid(0, 0);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() != parent) ::_exit(127);
    const int null = ::open("/dev/null", O_RDONLY);
    ::dup2(null, STDIN_FILENO);
    ::dup2(output, STDOUT_FILENO);
    ::dup2(output, STDERR_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  const int error = errno;
  ::close(output);
  if (pid_ < 0) throw std::runtime_error(fmt::format("cannot start {}: {}", path, std::strerror(error)));
}

BackgroundProgram::~BackgroundProgram() {
  if (!running()) return;
  ::kill(pid_, SIGKILL);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

bool BackgroundProgram::running() {
  if (status_ || pid_ <= 0) return false;
  int status = 0;
  if (::waitpid(pid_, &status, WNOHANG) != pid_) return true;
  status_ = status;
  return false;
}

std::string BackgroundProgram::how_it_ended() const {
  if (pid_ <= 0) return "could not be started";
  if (!status_) return "still runs";
  if (WIFSIGNALED(*status_)) return fmt::format("was ended by {}", ::sigdescr_np(WTERMSIG(*status_)));
  return fmt::format("ended with code {}", WEXITSTATUS(*status_));
}

void BackgroundProgram::ask_to_end() {
  if (running()) ::kill(pid_, SIGTERM);
}

std::string BackgroundProgram::last_output() const {
  std::ifstream file(log_, std::ios::binary);
  std::string text((std::istreambuf_iterator<char>(file)), {});
  const size_t kept = std::min<size_t>(text.size(), 1500);
  return text.substr(text.size() - kept);
}

}  // namespace woodcock
