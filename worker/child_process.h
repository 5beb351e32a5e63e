// Starts a render child, carries one attempt at a task through it, and says how it ended.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "rpc/child_program.h"
#include "worker/attempt_log.h"
#include "worker/child_messages.h"
#include "worker/message_channel.h"

namespace woodcock {

/// A child's first message: what its results are made with.
struct ChildIdentity {
  std::string render_build;
  std::string arithmetic_class;
};

/// How long the child may go without progress, per phase. Only its own reports of *moving* counters count, so
/// that a spinning child is found (HARD_CASES F08).
struct AttemptLimits {
  std::chrono::milliseconds loading{std::chrono::minutes(15)};
  std::chrono::milliseconds building{std::chrono::minutes(15)};
  std::chrono::milliseconds rendering{std::chrono::minutes(2)};
  std::chrono::milliseconds cancelling{std::chrono::seconds(5)};  ///< from cancel to the child's answer
};

struct AttemptFailure {
  FailureCause cause = FailureCause::kCrash;
  std::string reason;  ///< one sentence, with the last lines of the child's output where it helps
};
struct AttemptCancelled {};
using AttemptOutcome = std::variant<RenderedTile, AttemptFailure, AttemptCancelled>;

/// A running render child, which is killed with this object. Must live on the thread that made it: the
/// kernel ends the child when that thread ends.
class ChildProcess {
 public:
  /// `arguments` follow the program's name; "--channel-fd 3 --parent-pid P" are added. Throws std::system_error
  /// when it cannot be started.
  ChildProcess(const std::string& program, const std::vector<std::string>& arguments);

  /// Waits for the child's first message; nullopt when it died or said nothing for `timeout`.
  std::optional<ChildIdentity> wait_until_ready(std::chrono::milliseconds timeout, AttemptLog& log);

  /// Carries out one command. Returns when the child has answered, died, or was killed here because it hung
  /// or did not heed a cancel. `should_stop` is asked at least every 100 ms; once true the attempt is cancelled.
  /// `on_progress` is called when the counters have moved, and while the
  /// child loads or builds, which have no counters but time-outs of their own.
  AttemptOutcome run(const RenderCommand& command, const AttemptLimits& limits, AttemptLog& log, const std::function<bool()>& should_stop,
                     const std::function<void(const ChildProgress&)>& on_progress);

  /// False after the child died or was killed; make another one then.
  bool alive() const { return pid() > 0; }
  pid_t pid() const { return child_.pid(); }
  /// SIGKILL and reap; returns the wait status.
  int kill();

 private:
  struct Attempt;
  void wait_for_input(std::chrono::milliseconds timeout, AttemptLog& log);
  void drain_output(AttemptLog& log);
  AttemptFailure describe_death(AttemptLog& log);

  MessageChannel channel_;
  rpc::FileDescriptor output_;  // read end of the child's stdout and stderr, non-blocking
  rpc::ChildProgram child_;
};

}  // namespace woodcock
