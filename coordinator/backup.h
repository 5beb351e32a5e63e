// A back-up: a folder with database and blobs as they were at one moment. A coordinator can be started on a copy of it. Folders appear
// under their names only when everything in them is durable, and never in the place of another.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

namespace woodcock::coordinator {

/// What a back-up says of itself, in its file `backup.json`.
struct BackupRecord {
  std::string cluster_id;
  uint64_t leader_term = 0;  ///< a coordinator that starts on it takes a higher one
  int64_t unix_ms = 0;       ///< when it was made
  int64_t blobs = 0, bytes = 0;
  int64_t linked = 0;      ///< of the blobs: hard links, which take no room of their own
  int64_t unreadable = 0;  ///< damaged blobs that are not in it
};
std::string to_json(const BackupRecord& record);
/// Throws std::runtime_error on malformed text.
BackupRecord backup_record_from_json(const std::string& text);

/// A folder that is being filled. It goes again where it is not finished.
class NewFolder {
 public:
  /// Throws std::runtime_error when there is something of this name, it lies in `source`, the folder that it is made of, or the folder
  /// around it cannot be written.
  NewFolder(const std::string& target, const std::string& source);
  ~NewFolder();
  NewFolder(const NewFolder&) = delete;
  NewFolder& operator=(const NewFolder&) = delete;
  /// Where it is until it is finished: beside its name.
  const std::string& path() const { return path_; }
  /// Gives it its name. Throws std::runtime_error when there is something of this name by now.
  void finish();

 private:
  std::string target_, path_;
  bool finished_ = false;
};

/// Copies a file and makes the copy durable. Throws std::runtime_error.
void copy_durably(const std::string& from, const std::string& to);

/// Takes the blobs of a coordinator's folder into another one, by hard link where both are on one file system, and counts them in
/// `record`. Those that cannot be read are left out: they are damaged. Stops with std::runtime_error once `stopped`, or where the other
/// folder cannot be written.
void take_blobs(const std::string& from, const std::string& to, BackupRecord& record, const std::function<bool()>& stopped);

/// Writes `backup.json` and finishes the folder.
void finish_backup(NewFolder& folder, const BackupRecord& record);

/// A back-up of the folder of a coordinator that does not run. Throws std::runtime_error, also where one runs.
BackupRecord back_up_stopped(const std::string& dir, const std::string& target, int64_t unix_ms);

/// Makes the new folder `dir` of a back-up, which stays as it is. Throws std::runtime_error where it is no complete back-up, its database
/// is damaged, or `dir` exists.
BackupRecord restore_backup(const std::string& backup, const std::string& dir);

}  // namespace woodcock::coordinator
