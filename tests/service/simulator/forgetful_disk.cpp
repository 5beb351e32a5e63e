#include "tests/service/simulator/forgetful_disk.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

namespace woodcock::simulator {
namespace {

namespace fs = std::filesystem;

ForgetfulDisk* watching = nullptr;

constexpr size_t kBlock = 4096;

/// Reads the whole file into `bytes`, whose memory is used again. False where it was not opened for that.
bool read_into(std::string& bytes, int file, off_t size) {
  bytes.resize(static_cast<size_t>(size));
  for (size_t done = 0; done < bytes.size();) {
    const ssize_t n = ::pread(file, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
    if (n < 0) return false;
    if (n == 0) bytes.resize(done);
    done += static_cast<size_t>(n);
  }
  return true;
}

void read_into(std::string& bytes, const std::string& path) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  if (file < 0 || ::fstat(file, &status) != 0 || !read_into(bytes, file, status.st_size)) bytes.clear();
  if (file >= 0) ::close(file);
}

std::string read_all(const std::string& path) {
  std::string bytes;
  read_into(bytes, path);
  return bytes;
}

ino_t write_file(const std::string& path, std::string_view bytes) {
  const int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  struct stat status {};
  bool written = file >= 0 && ::fstat(file, &status) == 0;
  while (written && !bytes.empty()) {
    const ssize_t n = ::write(file, bytes.data(), bytes.size());
    written = n > 0;
    if (written) bytes.remove_prefix(static_cast<size_t>(n));
  }
  if (file >= 0) ::close(file);
  if (!written) throw std::runtime_error("the simulated disk cannot write " + path);
  return status.st_ino;
}

ino_t make_folder(const std::string& path) {
  struct stat status {};
  if ((::mkdir(path.c_str(), 0755) != 0 && errno != EEXIST) || ::stat(path.c_str(), &status) != 0)
    throw std::runtime_error("the simulated disk cannot make the folder " + path);
  return status.st_ino;
}

struct Entry {
  std::string name;
  ino_t inode = 0;
  bool is_folder = false;
};

std::vector<Entry> entries(const std::string& folder) {
  std::vector<Entry> list;
  DIR* stream = ::opendir(folder.c_str());
  if (!stream) return list;
  while (const dirent* entry = ::readdir(stream)) {
    const std::string name = entry->d_name;
    if (name != "." && name != "..") list.push_back({name, entry->d_ino, entry->d_type == DT_DIR});
  }
  ::closedir(stream);
  std::sort(list.begin(), list.end(), [](const Entry& a, const Entry& b) { return a.name < b.name; });
  return list;
}

void find_paths(const std::string& folder, std::unordered_map<ino_t, std::string>& paths) {
  for (const Entry& entry : entries(folder)) {
    if (entry.is_folder)
      find_paths(folder + "/" + entry.name, paths);
    else
      paths.emplace(entry.inode, folder + "/" + entry.name);
  }
}

/// A file whose bytes were `durable` when it was synced last, and are `written`. Where it grew its new blocks may be empty; where it
/// shrank the old ones are as they were, or gone.
std::string mixed(const std::string& durable, const std::string& written, Random& random) {
  if (durable == written) return durable;
  std::string bytes(random.chance(0.5) ? durable.size() : written.size(), '\0');
  for (size_t begin = 0; begin < bytes.size(); begin += kBlock) {
    const std::string& source = begin >= written.size() || random.chance(0.5) ? durable : written;
    if (begin < source.size()) source.copy(bytes.data() + begin, std::min(kBlock, bytes.size() - begin), begin);
  }
  return bytes;
}

void copy_all(const std::string& folder, const std::string& prefix, DiskImage& image) {
  for (const Entry& entry : entries(folder)) {
    const std::string path = folder + "/" + entry.name;
    if (entry.is_folder) {
      image.folders.insert(prefix + entry.name);
      copy_all(path, prefix + entry.name + "/", image);
    } else {
      image.files[prefix + entry.name] = read_all(path);
    }
  }
}

}  // namespace

ForgetfulDisk::ForgetfulDisk(const fs::path& root)
    : root_(root.string() + "/"),
      database_(
          root_,
          [this](const std::string& path) {
            if (before_sync) before_sync(path);
          },
          [this](const std::string& folder) { sync_folder(folder); }) {
  watching = this;
}
ForgetfulDisk::~ForgetfulDisk() { watching = nullptr; }

void ForgetfulDisk::sync_folder(const std::string& path) {
  Names& names = names_[path];
  names.clear();
  for (const Entry& entry : entries(path)) names.emplace(entry.name, entry.inode);
  database_.name_all(path);
}

bool ForgetfulDisk::sync(int descriptor) {
  char link[64], target[4096];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
  const ssize_t size = ::readlink(link, target, sizeof target);
  const std::string path(target, static_cast<size_t>(std::max<ssize_t>(size, 0)));
  if (!path.starts_with(root_)) return false;
  if (before_sync) before_sync(path);
  struct stat status {};
  if (::fstat(descriptor, &status) != 0) return true;
  if (S_ISDIR(status.st_mode)) {
    sync_folder(path);
  } else {
    std::string& bytes = bytes_[status.st_ino];
    if (!read_into(bytes, descriptor, status.st_size)) read_into(bytes, link);
  }
  return true;
}

DiskImage ForgetfulDisk::after_kill(const fs::path& folder) const {
  DiskImage image;
  copy_all(folder, "", image);
  for (const auto& [name, file] : database_.in_folder(folder)) image.files[name] = file->bytes();
  return image;
}

DiskImage ForgetfulDisk::after_power_cut(const fs::path& folder, Random& random) const {
  DiskImage image;
  std::unordered_map<ino_t, std::string> paths;
  find_paths(folder, paths);
  gather(folder, "", paths, random, image);
  for (const auto& [name, file] : database_.in_folder(folder))
    if (file->named() || random.chance(0.5)) image.files[name] = mixed(file->durable(), file->bytes(), random);
  return image;
}

void ForgetfulDisk::gather(const fs::path& folder, const std::string& prefix, const std::unordered_map<ino_t, std::string>& paths,
                           Random& random, DiskImage& image) const {
  std::map<std::string, std::pair<ino_t, ino_t>> all;  // of each name the durable inode and the present one
  std::set<std::string> folders;
  if (const auto durable = names_.find(folder); durable != names_.end())
    for (const auto& [name, inode] : durable->second) all[name].first = inode;
  for (const Entry& entry : entries(folder)) {
    all[entry.name].second = entry.inode;
    if (entry.is_folder) folders.insert(entry.name);
  }
  for (const auto& [name, inodes] : all) {
    const auto [durable, present] = inodes;
    const ino_t inode = durable == present || random.chance(0.5) ? present : durable;
    if (inode == 0) continue;
    if (folders.contains(name)) {
      image.folders.insert(prefix + name);
      gather(folder / name, prefix + name + "/", paths, random, image);
      continue;
    }
    const auto kept = bytes_.find(inode);
    const auto path = paths.find(inode);
    const std::string old = kept == bytes_.end() ? "" : kept->second;
    image.files[prefix + name] = path == paths.end() ? old : mixed(old, read_all(path->second), random);
  }
}

void ForgetfulDisk::lay_out(DiskImage image, const fs::path& folder) {
  const std::string root = folder.string();
  const auto name_it = [&](const std::string& name, ino_t inode) {
    const size_t slash = name.rfind('/');
    const bool at_top = slash == std::string::npos;
    names_[at_top ? root : root + "/" + name.substr(0, slash)].emplace(at_top ? name : name.substr(slash + 1), inode);
  };
  make_folder(root);
  names_[root];
  // A folder comes before what lies in it.
  for (const std::string& name : image.folders) {
    name_it(name, make_folder(root + "/" + name));
    names_[root + "/" + name];
  }
  for (auto& [name, bytes] : image.files) {
    if (DatabaseFiles::is_ones_name(name)) {
      database_.add(root + "/" + name, std::move(bytes));
      continue;
    }
    const ino_t inode = write_file(root + "/" + name, bytes);
    name_it(name, inode);
    bytes_[inode] = std::move(bytes);
  }
}

void ForgetfulDisk::remove_below(const std::string& folder) {
  for (const Entry& entry : entries(folder)) {
    const std::string path = folder + "/" + entry.name;
    if (entry.is_folder) {
      remove_below(path);
    } else {
      bytes_.erase(entry.inode);
      ::unlink(path.c_str());
    }
  }
  names_.erase(folder);
  ::rmdir(folder.c_str());
}

void ForgetfulDisk::remove(const fs::path& folder) {
  remove_below(folder.string());
  database_.remove_all(folder.string());
  // Folders that went before it did are durable names all the same.
  for (auto it = names_.lower_bound(folder.string() + "/"); it != names_.end() && it->first.starts_with(folder.string() + "/");)
    it = names_.erase(it);
}

}  // namespace woodcock::simulator

// In place of the C library's.
extern "C" {

int fsync(int descriptor) {
  using woodcock::simulator::watching;
  if (watching && watching->sync(descriptor)) return 0;
  return static_cast<int>(::syscall(SYS_fsync, descriptor));
}

int fdatasync(int descriptor) {
  using woodcock::simulator::watching;
  if (watching && watching->sync(descriptor)) return 0;
  return static_cast<int>(::syscall(SYS_fdatasync, descriptor));
}

int flock(int descriptor, int operation) noexcept {
  using woodcock::simulator::watching;
  if (watching && !watching->locks_hold) return 0;
  return static_cast<int>(::syscall(SYS_flock, descriptor, operation));
}
}
