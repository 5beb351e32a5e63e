// The local socket `control` in a coordinator's folder: whoever may write to the folder may ask for what touches the machine's disk.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <thread>

#include "coordinator/backup.h"

namespace woodcock::coordinator {

/// Serves one caller after the other: a line of JSON each way.
class ControlSocket {
 public:
  using BackUp = std::function<BackupRecord(const std::string& target)>;
  /// Throws std::runtime_error when the socket cannot be made. What stands in its place goes: the folder's lock is held.
  ControlSocket(const std::string& dir, BackUp back_up);
  /// Waits for the answer that is being made.
  ~ControlSocket();
  ControlSocket(const ControlSocket&) = delete;
  ControlSocket& operator=(const ControlSocket&) = delete;

 private:
  void run();
  void serve(int connection) const;

  const std::string path_;
  const BackUp back_up_;
  int listen_ = -1, stop_ = -1;
  std::thread thread_;
};

/// Has the coordinator that runs on the folder make a back-up, and waits for it. Nothing where none runs. Throws std::runtime_error with
/// what the coordinator answers, or when it ends meanwhile.
std::optional<BackupRecord> ask_for_backup(const std::string& dir, const std::string& target);

}  // namespace woodcock::coordinator
