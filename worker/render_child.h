// The render child: a process of its own, so that a crash, a hang or running out of memory costs one task and
// not the worker. It keeps compiled worlds from task to task.
#pragma once

#include <optional>
#include <stdexcept>
#include <string>

#include "worker/child_messages.h"

namespace woodcock {

/// An attempt that cannot succeed, with its cause; anything else a renderer throws counts as kScene.
class TaskFailure : public std::runtime_error {
 public:
  TaskFailure(FailureCause cause, const std::string& reason) : std::runtime_error(reason), cause_(cause) {}
  FailureCause cause() const { return cause_; }

 private:
  FailureCause cause_;
};

/// What the child does with a command. Passed in, so that supervision is tested without rendering anything.
class TaskRenderer {
 public:
  virtual ~TaskRenderer() = default;
  /// A command has arrived: forgets the progress and any cancel of the one before.
  virtual void begin() = 0;
  /// Renders and writes the tile; nullopt when cancelled since begin(). Always called on the same thread.
  virtual std::optional<RenderedTile> render(const RenderCommand& command) = 0;
  /// These two may be called from another thread while render() runs.
  virtual void cancel() = 0;
  virtual ChildProgress progress() const = 0;
  virtual std::string render_build() const = 0;
  virtual std::string arithmetic_class() const = 0;
};

/// A fault to inject, for tests only: "crash@N", "hang@N", "memory@N", "nan@N" or "exit@N" at the N-th task of
/// this child (from 1), or at every task for "@*".
struct TestHook {
  std::string fault;
  int task = 0;  ///< 0 means every task
  /// Throws std::invalid_argument when `text` is none of the above.
  static TestHook parse(const std::string& text);
};

struct RenderChildOptions {
  int channel_fd = 3;
  int parent_pid = 0;  ///< the child ends at once when this is no longer its parent; 0 skips the check
  std::optional<TestHook> test_hook;
};

/// Serves commands until the supervisor closes the line; the exit code of the process. Reports progress every
/// 100 ms while it renders.
int run_render_child(const RenderChildOptions& options, TaskRenderer& renderer);

}  // namespace woodcock
