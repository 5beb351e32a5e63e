// A back-up of a coordinator that runs.
#include <sys/stat.h>
#include <unistd.h>

#include "coordinator/coordinator.h"

namespace woodcock::coordinator {

BackupRecord Coordinator::back_up(const std::string& target) {
  // No blob goes meanwhile: what the copy of the database refers to is there when it is taken.
  const std::lock_guard no_clean_up(housekeeping_);
  NewFolder folder(target, options_.dir);
  BackupRecord record;
  record.cluster_id = store_->cluster_id();
  record.leader_term = store_->term();
  record.unix_ms = options_.unix_ms();
  // On the disk of the database first: the store must not wait for another one.
  struct Snapshot {
    std::string path;
    ~Snapshot() { ::unlink(path.c_str()); }
  } const snapshot{blobs_.temporary("backup.sqlite")};
  store_->copy_to(snapshot.path);
  options_.failpoint("backup-database-copied");  // a back-up has a copy of the database beside it
  copy_durably(snapshot.path, folder.path() + "/woodcock.sqlite");
  take_blobs(options_.dir, folder.path(), record, [this] { return stopping(); });
  options_.failpoint("backup-blobs-taken");  // it has all blobs, and not its name
  finish_backup(folder, record);
  return record;
}

}  // namespace woodcock::coordinator
