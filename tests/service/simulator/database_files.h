// The files of SQLite on the simulated disk, in memory: a transaction of a schedule costs no call of the system. SQLite gets them from a
// VFS of this program's, in the place of its own for Unix; it locks, syncs and names them as that one does.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace woodcock::simulator {

/// A file as it was written, and as it was when it was synced last.
class DatabaseFile {
 public:
  /// `named`: the bytes and the name are durable.
  DatabaseFile(std::string bytes, bool named) : bytes_(std::move(bytes)), durable_(named ? bytes_ : std::string()), named_(named) {}

  const std::string& bytes() const { return bytes_; }
  const std::string& durable() const { return durable_; }
  bool named() const { return named_; }
  void set_named() { named_ = true; }

  void write(size_t offset, const char* data, size_t size);
  void truncate(size_t size);
  void sync();

  /// SQLite's locks, each with the connection that has it.
  int readers = 0;
  const void *reserved = nullptr, *pending = nullptr;

 private:
  std::string bytes_, durable_;
  std::vector<std::pair<size_t, size_t>> changed_;  ///< [begin, end) since the last sync
  bool named_;
};

/// One at a time in a process; SQLite opens its files here as long as it lives.
class DatabaseFiles {
 public:
  /// Files whose paths begin with `root`. `before_sync` is called with the path of a file, or of its folder, before it becomes durable;
  /// `sync_folder` when SQLite syncs a folder.
  DatabaseFiles(std::string root, std::function<void(const std::string&)> before_sync, std::function<void(const std::string&)> sync_folder);
  ~DatabaseFiles();
  DatabaseFiles(const DatabaseFiles&) = delete;
  DatabaseFiles& operator=(const DatabaseFiles&) = delete;

  /// Whether a file of this name is SQLite's.
  static bool is_ones_name(const std::string& name);

  void add(const std::string& path, std::string bytes) { files_[path] = std::make_shared<DatabaseFile>(std::move(bytes), true); }
  /// Those directly in the folder, by name.
  std::map<std::string, std::shared_ptr<DatabaseFile>> in_folder(const std::string& folder) const;
  void name_all(const std::string& folder);
  void remove_all(const std::string& folder);

 private:
  friend struct Vfs;

  const std::string root_;
  const std::function<void(const std::string&)> before_sync_, sync_folder_;
  std::map<std::string, std::shared_ptr<DatabaseFile>> files_;  ///< by path
};

}  // namespace woodcock::simulator
