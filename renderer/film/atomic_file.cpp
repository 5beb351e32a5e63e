#include "renderer/film/atomic_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <fstream>

#include "renderer/film/tile.h"

namespace woodcock {

namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const char* what) {
  throw FilmError(path.string(), fmt::format("{}: {}", what, std::strerror(errno)));
}

std::filesystem::path folder_of(const std::filesystem::path& path) { return path.has_parent_path() ? path.parent_path() : "."; }

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : target_(std::move(target)) {
  static std::atomic<unsigned> counter{0};
  do {
    path_ = folder_of(target_) / fmt::format(".{}.{}-{}.tmp", target_.filename().string(), ::getpid(), counter++);
    descriptor_ = ::open(path_.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0666);
  } while (descriptor_ < 0 && errno == EEXIST);
  if (descriptor_ < 0) fail(target_, "cannot create a file there");
}

AtomicFile::~AtomicFile() {
  if (descriptor_ < 0) return;
  ::close(descriptor_);
  ::unlink(path_.c_str());
}

void AtomicFile::sync() {
  if (::fsync(descriptor_) != 0) fail(target_, "cannot make the file durable");
}

void AtomicFile::commit() {
  sync();
  if (::rename(path_.c_str(), target_.c_str()) != 0) fail(target_, "cannot give the file its name");
  ::close(descriptor_);
  descriptor_ = -1;
  const int folder = ::open(folder_of(target_).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder < 0) fail(target_, "cannot open the folder");
  const bool ok = ::fsync(folder) == 0;
  ::close(folder);
  if (!ok) fail(target_, "cannot make the file's name durable");
}

void write_text(const std::filesystem::path& path, std::string_view text) {
  AtomicFile file(path);
  std::ofstream out(file.path(), std::ios::binary);
  out << text;
  out.close();
  if (!out) throw FilmError(path.string(), "cannot be written");
  file.commit();
}

}  // namespace woodcock
