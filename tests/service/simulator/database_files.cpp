#include "tests/service/simulator/database_files.h"

#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string_view>

namespace woodcock::simulator {

void DatabaseFile::write(size_t offset, const char* data, size_t size) {
  const size_t begin = std::min(offset, bytes_.size());  // what lies between is zero, and new
  if (bytes_.size() < offset + size) bytes_.resize(offset + size);
  std::memcpy(bytes_.data() + offset, data, size);
  if (!changed_.empty() && changed_.back().second == begin)
    changed_.back().second = offset + size;
  else
    changed_.emplace_back(begin, offset + size);
}

void DatabaseFile::truncate(size_t size) {
  if (size >= bytes_.size()) return;
  // Whatever comes there later is new.
  changed_.emplace_back(size, SIZE_MAX);
  bytes_.resize(size);
}

void DatabaseFile::sync() {
  durable_.resize(bytes_.size());
  for (const auto& [begin, end] : changed_)
    if (begin < bytes_.size()) std::memcpy(durable_.data() + begin, bytes_.data() + begin, std::min(end, bytes_.size()) - begin);
  changed_.clear();
}

namespace {

DatabaseFiles* present = nullptr;

std::string folder_of(const std::string& path) { return path.substr(0, path.rfind('/')); }

/// A file that SQLite has opened.
struct Opened {
  std::shared_ptr<DatabaseFile> file;
  std::string path;
  bool folder_to_sync = false;  ///< with it, once: of a journal that may be new
  int level = SQLITE_LOCK_NONE;
};

/// What SQLite sees of it.
struct OpenedFile : sqlite3_file {
  Opened* opened;
};

Opened& opened(sqlite3_file* file) { return *static_cast<OpenedFile*>(file)->opened; }

}  // namespace

/// The functions that SQLite calls. Paths that are not of the simulated disk go to the VFS that it has otherwise.
struct Vfs {
  static sqlite3_vfs*& system() {
    static sqlite3_vfs* vfs = nullptr;
    return vfs;
  }
  static bool is_ours(const char* path) { return present && path && std::string_view(path).starts_with(present->root_); }

  static int open(sqlite3_vfs*, const char* path, sqlite3_file* file, int flags, int* out_flags) {
    if (!is_ours(path)) return system()->xOpen(system(), path, file, flags, out_flags);
    file->pMethods = nullptr;
    std::shared_ptr<DatabaseFile>& there = present->files_[path];
    const bool is_new = there == nullptr;
    if (is_new && (flags & SQLITE_OPEN_CREATE) == 0) {
      present->files_.erase(path);
      return SQLITE_CANTOPEN;
    }
    if (is_new) there = std::make_shared<DatabaseFile>(std::string(), false);
    const bool may_be_new = (flags & SQLITE_OPEN_MAIN_JOURNAL) != 0 && (flags & SQLITE_OPEN_CREATE) != 0;
    static_cast<OpenedFile*>(file)->opened = new Opened{there, path, may_be_new};
    file->pMethods = &methods();
    if (out_flags) *out_flags = flags;
    return SQLITE_OK;
  }
  static int remove(sqlite3_vfs*, const char* path, int sync_folder) {
    if (!is_ours(path)) return system()->xDelete(system(), path, sync_folder);
    return present->files_.erase(path) > 0 ? SQLITE_OK : SQLITE_IOERR_DELETE_NOENT;
  }
  static int access(sqlite3_vfs*, const char* path, int flags, int* result) {
    if (!is_ours(path)) return system()->xAccess(system(), path, flags, result);
    // An empty file is none to it, as with the VFS for Unix: a journal that was truncated.
    const auto found = present->files_.find(path);
    *result = found != present->files_.end() && !found->second->bytes().empty();
    return SQLITE_OK;
  }

  static int close(sqlite3_file* file) {
    unlock(file, SQLITE_LOCK_NONE);
    delete &opened(file);
    return SQLITE_OK;
  }
  static int read(sqlite3_file* file, void* to, int size, sqlite3_int64 offset) {
    const std::string& bytes = opened(file).file->bytes();
    const auto wanted = static_cast<size_t>(size), begin = std::min(static_cast<size_t>(offset), bytes.size());
    const size_t there = std::min(wanted, bytes.size() - begin);
    std::memcpy(to, bytes.data() + begin, there);
    if (there == wanted) return SQLITE_OK;
    std::memset(static_cast<char*>(to) + there, 0, wanted - there);
    return SQLITE_IOERR_SHORT_READ;
  }
  static int write(sqlite3_file* file, const void* from, int size, sqlite3_int64 offset) {
    opened(file).file->write(static_cast<size_t>(offset), static_cast<const char*>(from), static_cast<size_t>(size));
    return SQLITE_OK;
  }
  static int truncate(sqlite3_file* file, sqlite3_int64 size) {
    opened(file).file->truncate(static_cast<size_t>(size));
    return SQLITE_OK;
  }
  static int sync(sqlite3_file* file, int) {
    Opened& it = opened(file);
    if (!present) return SQLITE_OK;
    present->before_sync_(it.path);
    it.file->sync();
    if (!std::exchange(it.folder_to_sync, false)) return SQLITE_OK;
    const std::string folder = folder_of(it.path);
    present->before_sync_(folder);
    present->sync_folder_(folder);
    return SQLITE_OK;
  }
  static int size(sqlite3_file* file, sqlite3_int64* result) {
    *result = static_cast<sqlite3_int64>(opened(file).file->bytes().size());
    return SQLITE_OK;
  }

  static int lock(sqlite3_file* file, int level) {
    Opened& it = opened(file);
    DatabaseFile& locks = *it.file;
    const auto others = [&it](const void* owner) { return owner != nullptr && owner != &it; };
    if (level <= it.level) return SQLITE_OK;
    if (level == SQLITE_LOCK_SHARED) {
      if (others(locks.pending)) return SQLITE_BUSY;
      ++locks.readers;
    } else {
      if (others(locks.reserved) || others(locks.pending)) return SQLITE_BUSY;
      if (level == SQLITE_LOCK_RESERVED) {
        locks.reserved = &it;
      } else {
        locks.pending = &it;  // nobody begins to read
        it.level = SQLITE_LOCK_PENDING;
        if (locks.readers > 1) return SQLITE_BUSY;
      }
    }
    it.level = level;
    return SQLITE_OK;
  }
  static int unlock(sqlite3_file* file, int level) {
    Opened& it = opened(file);
    DatabaseFile& locks = *it.file;
    if (level >= it.level) return SQLITE_OK;
    if (locks.reserved == &it) locks.reserved = nullptr;
    if (locks.pending == &it) locks.pending = nullptr;
    if (level == SQLITE_LOCK_NONE) --locks.readers;
    it.level = level;
    return SQLITE_OK;
  }
  static int is_reserved(sqlite3_file* file, int* result) {
    const DatabaseFile& locks = *opened(file).file;
    *result = locks.reserved != nullptr || locks.pending != nullptr;
    return SQLITE_OK;
  }

  static int control(sqlite3_file*, int, void*) { return SQLITE_NOTFOUND; }
  static int sector_size(sqlite3_file*) { return 4096; }
  static int characteristics(sqlite3_file*) { return SQLITE_IOCAP_POWERSAFE_OVERWRITE; }  // as on Unix

  static const sqlite3_io_methods& methods() {
    static const sqlite3_io_methods methods = [] {
      sqlite3_io_methods made{};
      made.iVersion = 1;
      made.xClose = close;
      made.xRead = read;
      made.xWrite = write;
      made.xTruncate = truncate;
      made.xSync = sync;
      made.xFileSize = size;
      made.xLock = lock;
      made.xUnlock = unlock;
      made.xCheckReservedLock = is_reserved;
      made.xFileControl = control;
      made.xSectorSize = sector_size;
      made.xDeviceCharacteristics = characteristics;
      return made;
    }();
    return methods;
  }

  /// Once in a process: SQLite's own VFS, but for three functions.
  static void install() {
    if (system()) return;
    system() = sqlite3_vfs_find(nullptr);
    static sqlite3_vfs vfs = *system();
    vfs.zName = "woodcock-simulator";
    vfs.szOsFile = std::max(system()->szOsFile, static_cast<int>(sizeof(OpenedFile)));
    vfs.pNext = nullptr;
    vfs.xOpen = open;
    vfs.xDelete = remove;
    vfs.xAccess = access;
    if (sqlite3_vfs_register(&vfs, 1) != SQLITE_OK) throw std::runtime_error("SQLite takes no files of the simulated disk");
  }
};

DatabaseFiles::DatabaseFiles(std::string root, std::function<void(const std::string&)> before_sync,
                             std::function<void(const std::string&)> sync_folder)
    : root_(std::move(root)), before_sync_(std::move(before_sync)), sync_folder_(std::move(sync_folder)) {
  Vfs::install();
  present = this;
}

DatabaseFiles::~DatabaseFiles() { present = nullptr; }

bool DatabaseFiles::is_ones_name(const std::string& name) { return name.ends_with(".sqlite") || name.ends_with(".sqlite-journal"); }

std::map<std::string, std::shared_ptr<DatabaseFile>> DatabaseFiles::in_folder(const std::string& folder) const {
  std::map<std::string, std::shared_ptr<DatabaseFile>> found;
  const std::string prefix = folder + "/";
  for (auto it = files_.lower_bound(prefix); it != files_.end() && it->first.starts_with(prefix); ++it)
    if (const std::string name = it->first.substr(prefix.size()); name.find('/') == std::string::npos) found.emplace(name, it->second);
  return found;
}

void DatabaseFiles::name_all(const std::string& folder) {
  for (const auto& [name, file] : in_folder(folder)) file->set_named();
}

void DatabaseFiles::remove_all(const std::string& folder) {
  const std::string prefix = folder + "/";
  for (auto it = files_.lower_bound(prefix); it != files_.end() && it->first.starts_with(prefix);) it = files_.erase(it);
}

}  // namespace woodcock::simulator
