// Programs that this one starts as its children: all of them are started here.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace woodcock::rpc {

/// How a program is started. Of our descriptors it gets those that are named here and no others.
struct ChildStart {
  std::string program;                 ///< a path
  std::vector<std::string> arguments;  ///< those after its name
  std::string name{};                  ///< what `ps` shows; empty: the path
  /// By its number in the child, 0 to 9: our descriptor. Input that is not named is /dev/null; output and errors are ours then.
  std::map<int, int> descriptors{};
  std::string folder{};             ///< where it works; empty: where we do
  bool empty_environment = false;   ///< it needs nothing of ours
  bool own_group = false;           ///< a process group of its own, which Ctrl-C does not reach
  bool no_blocked_signals = false;  ///< it begins with none blocked, whatever this thread blocks
};

/// A child: it gets SIGKILL when this object goes, and when the thread ends that started it. One thread at a time; signal() may be called
/// by others as long as nobody waits.
class ChildProgram {
 public:
  ChildProgram() = default;
  /// Throws std::system_error when it cannot be started, also where only the exec fails.
  explicit ChildProgram(const ChildStart& start);
  ~ChildProgram() { kill(); }
  ChildProgram(ChildProgram&& other) noexcept;
  ChildProgram& operator=(ChildProgram&& other) noexcept;

  /// -1 when there is none, or when it has ended and that was seen.
  pid_t pid() const { return pid_; }
  /// Its wait status once it has ended; nothing while it runs, or where it was never started.
  std::optional<int> status();
  bool running() { return pid_ > 0 && !status(); }
  /// Waits for its end, at most until `deadline`: nothing when it still runs then.
  std::optional<int> wait_until(std::chrono::steady_clock::time_point deadline);
  /// Waits for its end, however long that takes. Throws std::logic_error where nothing was started.
  int wait();
  void signal(int number) const;
  /// SIGKILL, and waits for the end. Its status; nothing where it was never started.
  std::optional<int> kill();

 private:
  pid_t pid_ = -1;
  std::optional<int> status_;
};

}  // namespace woodcock::rpc
