// Loaded before the libraries of a program (LD_PRELOAD). While the file WOODCOCK_FAILING_DISK names exists, writes to a database, or
// what makes them durable, fail with EIO: the file's first word is "write" or "sync". All else goes to the C library.
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <sys/types.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

/// Whether the descriptor is a file of a database, and such calls are to fail now.
bool fails(int fd, const char* what) {
  const char* switch_path = std::getenv("WOODCOCK_FAILING_DISK");
  if (switch_path == nullptr || ::access(switch_path, F_OK) != 0) return false;
  char link[64], path[4096], word[16] = {};
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t size = ::readlink(link, path, sizeof path - 1);
  if (size <= 0) return false;
  path[size] = '\0';
  if (std::strstr(path, ".sqlite") == nullptr) return false;
  const int file = ::open(switch_path, O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  const ssize_t read = ::read(file, word, sizeof word - 1);
  ::close(file);
  return read > 0 && std::strncmp(word, what, std::strlen(what)) == 0;
}

}  // namespace

extern "C" {

int fsync(int fd) {
  static const auto real = next<int (*)(int)>("fsync");
  if (!fails(fd, "sync")) return real(fd);
  errno = EIO;
  return -1;
}

int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  if (!fails(fd, "sync")) return real(fd);
  errno = EIO;
  return -1;
}

ssize_t write(int fd, const void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  if (!fails(fd, "write")) return real(fd, data, size);
  errno = EIO;
  return -1;
}

ssize_t pwrite(int fd, const void* data, size_t size, off_t offset) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite");
  if (!fails(fd, "write")) return real(fd, data, size, offset);
  errno = EIO;
  return -1;
}

ssize_t pwrite64(int fd, const void* data, size_t size, off64_t offset) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64");
  if (!fails(fd, "write")) return real(fd, data, size, offset);
  errno = EIO;
  return -1;
}
}
