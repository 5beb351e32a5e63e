// The folder a worker lives in: its identity, its lock, and where everything else is.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "rpc/file_descriptor.h"

namespace woodcock {

/// Opened by one process at a time. The worker id is made once and stays; the incarnation grows with every start, so
/// that a coordinator can tell this process from the ones before.
class WorkerFolder {
 public:
  /// Makes the folder if need be. Throws std::runtime_error with a sentence for the user: another worker uses it, it
  /// cannot be written, it holds a damaged identity.
  explicit WorkerFolder(const std::filesystem::path& folder);

  const std::string& worker_id() const { return worker_id_; }
  uint64_t incarnation() const { return incarnation_; }
  std::filesystem::path spool() const { return folder_ / "spool"; }
  std::filesystem::path assets() const { return folder_ / "assets"; }
  std::filesystem::path logs() const { return folder_ / "logs"; }

  /// DIR/ready exists from the first answer of a coordinator until the next start: scripts wait for it.
  void mark_ready() const;

 private:
  std::filesystem::path folder_;
  rpc::FileDescriptor lock_;
  std::string worker_id_;
  uint64_t incarnation_ = 0;
};

/// This machine's name, at most 255 bytes.
std::string host_name();

}  // namespace woodcock
