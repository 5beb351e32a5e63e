#include "worker/worker_folder.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <random>
#include <stdexcept>

#include "renderer/film/atomic_file.h"
#include "rpc/printable.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

/// The first line of a small file; empty if there is no such file.
std::string read_line(const fs::path& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  return line;
}

void write_line(const fs::path& path, const std::string& line) {
  AtomicFile file(path);
  std::ofstream(file.path()) << line << '\n';
  file.commit();
}

std::string random_id() {
  std::random_device random;
  return fmt::format("w-{:08x}{:08x}{:08x}", random(), random(), random());
}

bool is_number(const std::string& text) {
  return !text.empty() && text.size() < 19 && text.find_first_not_of("0123456789") == std::string::npos;
}

}  // namespace

WorkerFolder::WorkerFolder(const fs::path& folder) : folder_(fs::absolute(folder)) {
  try {
    fs::create_directories(folder_);
    for (const fs::path& part : {spool(), assets(), logs()}) fs::create_directories(part);
  } catch (const fs::filesystem_error& error) {
    throw std::runtime_error(fmt::format("cannot make the worker's folder {}: {}", folder_.string(), error.code().message()));
  }
  const std::string lock_path = folder_ / "lock";
  lock_ = rpc::FileDescriptor(::open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (!lock_) throw std::runtime_error(fmt::format("cannot open {}: {}", lock_path, std::strerror(errno)));
  if (::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0)
    throw std::runtime_error(fmt::format("another worker runs in {}: give each worker a folder of its own (--dir)", folder_.string()));

  std::error_code ignored;
  fs::remove(folder_ / "ready", ignored);
  worker_id_ = read_line(folder_ / "worker-id");
  if (worker_id_.empty()) {
    worker_id_ = random_id();
    write_line(folder_ / "worker-id", worker_id_);
  }
  const std::string last = read_line(folder_ / "incarnation");
  if (!last.empty() && !is_number(last))
    throw std::runtime_error(fmt::format("{} is damaged: remove the folder (finished results in it will be rendered again)",
                                         (folder_ / "incarnation").string()));
  incarnation_ = last.empty() ? 1 : std::stoull(last) + 1;
  write_line(folder_ / "incarnation", std::to_string(incarnation_));
}

void WorkerFolder::mark_ready() const { std::ofstream(folder_ / "ready") << worker_id_ << '\n'; }

std::string host_name() {
  char name[256] = {};
  return ::gethostname(name, sizeof name - 1) == 0 ? rpc::printable(name) : "unknown";
}

}  // namespace woodcock
