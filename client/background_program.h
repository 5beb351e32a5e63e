// A program started beside this one, which ends with it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "rpc/child_program.h"

namespace woodcock {

/// Runs in a process group of its own, so that Ctrl-C reaches it through us only; gets SIGKILL when the thread that
/// started it ends, and when this object goes. Its output goes to a log file.
class BackgroundProgram {
 public:
  /// `program` lies in the folder of this executable. Its log is begun anew. Throws std::runtime_error when it cannot be started.
  BackgroundProgram(const std::string& program, const std::vector<std::string>& arguments, const std::filesystem::path& log);

  /// Starts it again after it has ended, with the same arguments, or those given; its log goes on. Throws as the constructor does.
  void start_again();
  void set_arguments(const std::vector<std::string>& arguments) { arguments_ = arguments; }

  const std::string& name() const { return name_; }
  /// False once it has ended; `how` it did is then said by how_it_ended().
  bool running() { return child_.running(); }
  std::string how_it_ended();
  /// SIGTERM.
  void ask_to_end();
  /// The last lines of its log.
  std::string last_output() const;

 private:
  void start(int log_flags);

  std::string name_, program_;
  std::vector<std::string> arguments_;
  std::filesystem::path log_;
  bool started_ = false;
  rpc::ChildProgram child_;
};

/// The folder of this executable.
std::filesystem::path program_folder();

}  // namespace woodcock
