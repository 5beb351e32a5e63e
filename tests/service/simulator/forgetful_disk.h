// A disk that forgets what was not synced. Files lie in a real folder; this program's fsync and fdatasync come here (they replace those of
// the C library), and note what is durable: the bytes of a synced file, the names in a synced folder. Those of the database lie in memory
// (database_files.h).
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <unordered_map>

#include "tests/service/simulator/database_files.h"
#include "tests/service/simulator/random.h"

namespace woodcock::simulator {

/// What lies in a folder, paths relative to it.
struct DiskImage {
  std::map<std::string, std::string> files;
  std::set<std::string> folders;
};

/// One at a time in a process.
class ForgetfulDisk {
 public:
  /// Watches all below `root`; no sync below it reaches the kernel.
  explicit ForgetfulDisk(const std::filesystem::path& root);
  ~ForgetfulDisk();
  ForgetfulDisk(const ForgetfulDisk&) = delete;
  ForgetfulDisk& operator=(const ForgetfulDisk&) = delete;

  /// Called with the path before each sync below the root.
  std::function<void(const std::string& path)> before_sync;
  /// Whether the lock of a folder keeps a second process out. An outdated leader has lost its lock and does not know.
  bool locks_hold = true;

  /// The folder when its process is killed: the kernel has what was written.
  DiskImage after_kill(const std::filesystem::path& folder) const;
  /// The same after a power cut: what is durable, and of the rest some, at random: each block of 4 KiB of a file, each name.
  DiskImage after_power_cut(const std::filesystem::path& folder, Random& random) const;
  /// Makes the folder of an image; all of it is durable. SQLite's files lie at its top.
  void lay_out(DiskImage image, const std::filesystem::path& folder);
  /// Removes the folder.
  void remove(const std::filesystem::path& folder);

  /// fsync of a descriptor. False where it is not below the root.
  bool sync(int descriptor);

 private:
  using Names = std::map<std::string, ino_t>;

  void gather(const std::filesystem::path& folder, const std::string& prefix, const std::unordered_map<ino_t, std::string>& paths,
              Random& random, DiskImage& image) const;
  void remove_below(const std::string& folder);
  void sync_folder(const std::string& path);

  const std::string root_;
  DatabaseFiles database_;
  std::unordered_map<ino_t, std::string> bytes_;  ///< durable ones, by inode
  std::map<std::string, Names> names_;            ///< durable ones, by folder
};

}  // namespace woodcock::simulator
