#include "tests/service/simulator/forgetful_disk.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <vector>

namespace woodcock::simulator {
namespace {

namespace fs = std::filesystem;

ForgetfulDisk* watching = nullptr;

constexpr size_t kBlock = 4096;

std::string read_all(const std::string& path) {
  std::string bytes;
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return bytes;
  struct stat status {};
  ::fstat(file, &status);
  bytes.resize(static_cast<size_t>(status.st_size));
  size_t done = 0;
  for (ssize_t n = 1; done < bytes.size() && n > 0; done += static_cast<size_t>(std::max<ssize_t>(n, 0)))
    n = ::pread(file, bytes.data() + done, bytes.size() - done, static_cast<off_t>(done));
  ::close(file);
  bytes.resize(done);
  return bytes;
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

ForgetfulDisk::ForgetfulDisk(const fs::path& root) : root_(root.string() + "/") { watching = this; }
ForgetfulDisk::~ForgetfulDisk() { watching = nullptr; }

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
    Names& names = names_[path];
    names.clear();
    for (const Entry& entry : entries(path)) names.emplace(entry.name, entry.inode);
  } else {
    bytes_[status.st_ino] = read_all(link);
  }
  return true;
}

DiskImage ForgetfulDisk::after_kill(const fs::path& folder) const {
  DiskImage image;
  copy_all(folder, "", image);
  return image;
}

DiskImage ForgetfulDisk::after_power_cut(const fs::path& folder, Random& random) const {
  DiskImage image;
  std::unordered_map<ino_t, std::string> paths;
  find_paths(folder, paths);
  gather(folder, "", paths, random, image);
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

void ForgetfulDisk::lay_out(const DiskImage& image, const fs::path& folder) {
  fs::create_directories(folder);
  for (const std::string& name : image.folders) fs::create_directories(folder / name);
  for (const auto& [name, bytes] : image.files) {
    const std::string path = folder / name;
    std::ofstream(path, std::ios::binary) << bytes;
    struct stat status {};
    if (::stat(path.c_str(), &status) != 0) throw std::runtime_error("the simulated disk cannot write " + path);
    bytes_[status.st_ino] = bytes;
  }
  std::set<std::string> all{""};
  for (const std::string& name : image.folders) all.insert("/" + name);
  for (const std::string& name : all) {
    Names& names = names_[folder.string() + name];
    for (const Entry& entry : entries(folder.string() + name)) names.emplace(entry.name, entry.inode);
  }
}

void ForgetfulDisk::remove(const fs::path& folder) {
  std::unordered_map<ino_t, std::string> paths;
  find_paths(folder, paths);
  for (const auto& [inode, path] : paths) bytes_.erase(inode);
  for (auto it = names_.lower_bound(folder); it != names_.end() && it->first.starts_with(folder.string());) it = names_.erase(it);
  std::error_code ignored;
  fs::remove_all(folder, ignored);
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
