#include "coordinator/backup.h"

#include <fcntl.h>
#include <linux/fs.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "coordinator/blob_store.h"
#include "rpc/file_descriptor.h"

namespace woodcock::coordinator {
namespace fs = std::filesystem;
namespace {

constexpr int kFormat = 1;
constexpr const char* kDatabase = "/woodcock.sqlite";
constexpr const char* kRecord = "/backup.json";

[[noreturn]] void fail(const std::string& what, int error) { throw std::runtime_error(what + ": " + std::strerror(error)); }

void sync_folder(const std::string& path) {
  const rpc::FileDescriptor folder{::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)};
  if (folder.get() < 0 || ::fsync(folder.get()) != 0) fail("fsync of " + path, errno);
}

std::string parent_of(const std::string& path) {
  const fs::path parent = fs::path(path).parent_path();
  return parent.empty() ? "." : parent.string();
}

enum class Copied { Yes, Unreadable };

/// Throws where the copy cannot be written.
Copied copy_bytes(const std::string& from, const std::string& to) {
  const rpc::FileDescriptor in{::open(from.c_str(), O_RDONLY | O_CLOEXEC)};
  if (in.get() < 0) return Copied::Unreadable;
  const rpc::FileDescriptor out{::open(to.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644)};
  if (out.get() < 0) fail("making " + to, errno);
  std::string buffer(1 << 20, '\0');
  for (;;) {
    const ssize_t n = ::read(in.get(), buffer.data(), buffer.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      ::unlink(to.c_str());
      return Copied::Unreadable;
    }
    if (n == 0) break;
    for (ssize_t done = 0; done < n;) {
      const ssize_t written = ::write(out.get(), buffer.data() + done, static_cast<size_t>(n - done));
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail("writing " + to, errno);
      done += written;
    }
  }
  // A clean-up may have to go by it.
  struct stat status {};
  if (::fstat(in.get(), &status) == 0) {
    const timespec times[2] = {status.st_atim, status.st_mtim};
    ::futimens(out.get(), times);
  }
  if (::fsync(out.get()) != 0) fail("fsync of " + to, errno);
  return Copied::Yes;
}

/// "ok", or what is wrong with the database.
std::string check_database(const std::string& path) {
  try {
    soci::session sql(soci::sqlite3, "db=" + path);
    std::string verdict;
    sql << "pragma quick_check(1)", soci::into(verdict);
    return verdict;
  } catch (const soci::soci_error& error) {
    return error.what();
  }
}

void read_leader(const std::string& database, BackupRecord& record) {
  try {
    soci::session sql(soci::sqlite3, "db=" + database);
    long long term = 0;
    sql << "select term, cluster_id from leader where id = 1", soci::into(term), soci::into(record.cluster_id);
    record.leader_term = static_cast<uint64_t>(term);
  } catch (const soci::soci_error& error) {
    throw std::runtime_error("the database " + database + " cannot be read: " + error.what());
  }
}

}  // namespace

std::string to_json(const BackupRecord& r) {
  return nlohmann::json{{"format", kFormat}, {"cluster_id", r.cluster_id}, {"leader_term", r.leader_term}, {"unix_ms", r.unix_ms},
                        {"blobs", r.blobs},  {"bytes", r.bytes},           {"linked", r.linked},           {"unreadable", r.unreadable}}
      .dump();
}

BackupRecord backup_record_from_json(const std::string& text) {
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    if (json.at("format").get<int>() != kFormat)
      throw std::runtime_error("a back-up of format " + std::to_string(json.at("format").get<int>()) + ", expected " +
                               std::to_string(kFormat) + ": use a matching program");
    return {json.at("cluster_id").get<std::string>(), json.at("leader_term").get<uint64_t>(), json.at("unix_ms").get<int64_t>(),
            json.at("blobs").get<int64_t>(),          json.at("bytes").get<int64_t>(),        json.at("linked").get<int64_t>(),
            json.at("unreadable").get<int64_t>()};
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(std::string("malformed record of a back-up: ") + error.what());
  }
}

NewFolder::NewFolder(const std::string& target, const std::string& source) : target_(fs::path(target).lexically_normal().string()) {
  while (target_.size() > 1 && target_.back() == '/') target_.pop_back();
  if (target.empty()) throw std::runtime_error("expected the name of a folder to make, found none");
  struct stat status {};
  if (::lstat(target_.c_str(), &status) == 0)
    throw std::runtime_error(target_ + " is there already: give a name that is not, or move it away");
  const fs::path inside = fs::weakly_canonical(fs::absolute(target_)).lexically_relative(fs::weakly_canonical(fs::absolute(source)));
  if (!inside.empty() && *inside.begin() != "..")
    throw std::runtime_error(target_ + " lies in " + source + ", which it is made of: give a folder outside");
  path_ = target_ + ".unfinished-XXXXXX";
  if (!::mkdtemp(path_.data())) fail("making a folder in " + parent_of(target_), errno);
}

NewFolder::~NewFolder() {
  std::error_code ignored;
  if (!finished_) fs::remove_all(path_, ignored);
}

void NewFolder::finish() {
  sync_folder(path_);
  // What came under this name meanwhile stays.
  if (::syscall(SYS_renameat2, AT_FDCWD, path_.c_str(), AT_FDCWD, target_.c_str(), RENAME_NOREPLACE) != 0)
    fail("giving the folder its name " + target_, errno);
  finished_ = true;
  sync_folder(parent_of(target_));
}

void copy_durably(const std::string& from, const std::string& to) {
  if (copy_bytes(from, to) == Copied::Unreadable) fail("reading " + from, errno);
}

void take_blobs(const std::string& from, const std::string& to, BackupRecord& record, const std::function<bool()>& stopped) {
  const fs::path source = fs::path(from) / "blobs", target = fs::path(to) / "blobs";
  if (::mkdir(target.c_str(), 0755) != 0) fail("making " + target.string(), errno);
  std::error_code error;
  for (fs::directory_iterator folder(source, error), end; !error && folder != end; folder.increment(error)) {
    // Of what is not ours, such as lost+found, nothing is taken.
    if (!is_hexadecimal(folder->path().filename(), 2)) continue;
    const fs::path there = target / folder->path().filename();
    if (::mkdir(there.c_str(), 0755) != 0) fail("making " + there.string(), errno);
    std::error_code unread;
    for (fs::directory_iterator blob(folder->path(), unread); !unread && blob != fs::directory_iterator(); blob.increment(unread)) {
      const std::string name = blob->path().filename();
      struct stat status {};
      if (!is_hexadecimal(name, 64) || ::stat(blob->path().c_str(), &status) != 0 || !S_ISREG(status.st_mode)) continue;
      if (stopped()) throw std::runtime_error("the coordinator is stopping");
      const std::string copy = there / name;
      const bool linked = ::link(blob->path().c_str(), copy.c_str()) == 0;
      if (!linked && errno == ENOENT) continue;
      if (!linked && copy_bytes(blob->path(), copy) == Copied::Unreadable) {
        ++record.unreadable;
        continue;
      }
      ++record.blobs;
      record.linked += linked;
      record.bytes += status.st_size;
    }
    if (unread) ++record.unreadable;
    sync_folder(there);
  }
  if (error && error != std::errc::no_such_file_or_directory)
    throw std::runtime_error("the folder " + source.string() + " cannot be read: " + error.message());
  sync_folder(target);
}

void finish_backup(NewFolder& folder, const BackupRecord& record) {
  const std::string path = folder.path() + kRecord;
  const std::string text = to_json(record) + "\n";
  const rpc::FileDescriptor file{::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644)};
  if (file.get() < 0 || ::write(file.get(), text.data(), text.size()) != static_cast<ssize_t>(text.size()) || ::fsync(file.get()) != 0)
    fail("writing " + path, errno);
  folder.finish();
}

BackupRecord back_up_stopped(const std::string& dir, const std::string& target, int64_t unix_ms) {
  if (!fs::exists(dir + kDatabase)) throw std::runtime_error("there is no coordinator's database in " + dir + ": expected woodcock.sqlite");
  const rpc::FileDescriptor lock{::open((dir + "/lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)};
  if (lock.get() < 0) fail("opening " + dir + "/lock", errno);
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0)
    throw std::runtime_error("a coordinator runs on " + dir + " and does not answer at its file `control`; try again, or stop it");
  NewFolder folder(target, dir);
  BackupRecord record;
  record.unix_ms = unix_ms;
  // Rolls back what a crash left half done.
  if (const std::string verdict = check_database(dir + kDatabase); verdict != "ok")
    throw std::runtime_error("the database in " + dir + " is damaged: " + verdict);
  read_leader(dir + kDatabase, record);
  copy_durably(dir + kDatabase, folder.path() + kDatabase);
  take_blobs(dir, folder.path(), record, [] { return false; });
  finish_backup(folder, record);
  return record;
}

BackupRecord restore_backup(const std::string& backup, const std::string& dir) {
  std::ifstream in(backup + kRecord);
  if (!in) throw std::runtime_error(backup + " is no complete back-up: its file backup.json is missing");
  const BackupRecord record = backup_record_from_json({std::istreambuf_iterator<char>(in), {}});
  NewFolder folder(dir, backup);
  // A copy: the coordinator writes to it.
  copy_durably(backup + kDatabase, folder.path() + kDatabase);
  if (const std::string verdict = check_database(folder.path() + kDatabase); verdict != "ok")
    throw std::runtime_error("the database of the back-up " + backup + " is damaged: " + verdict);
  BackupRecord restored = record;
  restored.blobs = restored.bytes = restored.linked = restored.unreadable = 0;
  take_blobs(backup, folder.path(), restored, [] { return false; });
  restored.unreadable = std::max(restored.unreadable, record.blobs - restored.blobs);
  folder.finish();
  return restored;
}

}  // namespace woodcock::coordinator
