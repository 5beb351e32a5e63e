// The process that forks one merge after the other.
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <exception>
#include <optional>
#include <string>

#include "coordinator/assembler.h"
#include "coordinator/merge_messages.h"
#include "coordinator/merge_pool.h"

namespace woodcock::coordinator {
namespace {

[[maybe_unused]] constexpr rlim_t kMemoryLimit = rlim_t{16} << 30;
constexpr size_t kMaxReply = 8 << 20;

/// In the process that merges: writes the result to `output` and ends.
[[noreturn]] void merge_and_exit(const std::string& request, int output, pid_t server) {
  // A coordinator that was killed is started again and clears its temporary files: nothing may write there any more.
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != server) ::_exit(1);
  // The next merges are no business of this one.
  const int null = ::open("/dev/null", O_RDWR | O_CLOEXEC);
  ::dup2(null, STDIN_FILENO);
  ::dup2(null, STDOUT_FILENO);
#ifndef __SANITIZE_ADDRESS__  // its shadow is larger than any limit
  const rlimit memory{kMemoryLimit, kMemoryLimit};
  ::setrlimit(RLIMIT_AS, &memory);
#endif
  const rlimit core{0, 0};
  ::setrlimit(RLIMIT_CORE, &core);
  AssembleResult result;
  try {
    result = assemble(request_from_text(request));
  } catch (const std::exception& error) {
    result.error = error.what();
  }
  const std::string text = text_of(result);
  for (size_t done = 0; done < text.size();) {
    const ssize_t n = ::write(output, text.data() + done, text.size() - done);
    if (n < 0 && errno != EINTR) ::_exit(1);
    if (n > 0) done += static_cast<size_t>(n);
  }
  // Nothing of what the libraries would do at the end is needed.
  ::_exit(0);
}

/// Forks a merge and waits for it.
std::string merge_in_child(const std::string& request) {
  const pid_t server = ::getpid();
  int pipe_fds[2];
  if (::pipe2(pipe_fds, O_CLOEXEC) != 0) return std::string(kCrashed) + "pipe: " + std::strerror(errno);
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(pipe_fds[0]);
    merge_and_exit(request, pipe_fds[1], server);
  }
  const int error = errno;
  ::close(pipe_fds[1]);
  std::string reply;
  if (child < 0) {
    reply = std::string(kCrashed) + "fork: " + std::strerror(error);
  } else {
    // Replies go to standard output, whose other end the coordinator holds.
    const std::optional<std::string> text = read_to_end(pipe_fds[0], kMaxReply, STDOUT_FILENO);
    if (!text) ::kill(child, SIGKILL);
    int status = 0;
    while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
    if (text && WIFEXITED(status) && WEXITSTATUS(status) == 0)
      reply = *text;
    else if (WIFSIGNALED(status) && text)
      reply = std::string(kCrashed) + "the merge ended by signal " + ::strsignal(WTERMSIG(status));
    else
      reply = std::string(kCrashed) + "the merge gave no result";
  }
  ::close(pipe_fds[0]);
  return reply;
}

}  // namespace

int merge_server_main(pid_t parent) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) return 1;
  try {
    while (const std::optional<std::string> request = receive_message(STDIN_FILENO, std::chrono::steady_clock::time_point::max()))
      send_message(STDOUT_FILENO, merge_in_child(*request));
    return 0;
  } catch (const std::exception&) {
    return 1;  // nobody is there to tell
  }
}

}  // namespace woodcock::coordinator
