// A copy of the database beside what is written: pages go over between two transactions, so that nobody waits for more than some of them.
#include <unistd.h>

#include <stdexcept>
#include <utility>

#include "coordinator/statement_cache.h"
#include "coordinator/store.h"
#include "coordinator/store_sql.h"

namespace woodcock::coordinator {
namespace {

/// Of a step: a mebibyte, as SQLite makes them.
constexpr int kPages = 256;

}  // namespace

/// Both of the store's thread. What is written through the connection meanwhile reaches pages that were copied already.
struct Store::Copy {
  std::string path;
  std::promise<void> done;
  sqlite_api::sqlite3* to = nullptr;
  sqlite_api::sqlite3_backup* backup = nullptr;

  explicit Copy(std::string file) : path(std::move(file)) {}
  Copy(const Copy&) = delete;
  Copy& operator=(const Copy&) = delete;
  ~Copy() { close(); }
  void close() {
    if (backup) sqlite_api::sqlite3_backup_finish(backup);
    if (to) sqlite_api::sqlite3_close(to);
    backup = nullptr;
    to = nullptr;
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error("the database cannot be copied to " + path + ": " + what);
  }
  void begin(sqlite_api::sqlite3* from) {
    if (::access(path.c_str(), F_OK) == 0) fail("there is a file of this name");
    constexpr int kFlags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
    if (sqlite_api::sqlite3_open_v2(path.c_str(), &to, kFlags, nullptr) != SQLITE_OK) fail(sqlite_api::sqlite3_errmsg(to));
    // Whoever asked makes the whole file durable, on a thread of his own.
    sqlite_api::sqlite3_exec(to, "pragma synchronous = off", nullptr, nullptr, nullptr);
    sqlite_api::sqlite3_exec(to, "pragma journal_mode = off", nullptr, nullptr, nullptr);
    backup = sqlite_api::sqlite3_backup_init(to, "main", from, "main");
    if (!backup) fail(sqlite_api::sqlite3_errmsg(to));
  }
  /// True when all is there.
  bool step() {
    const int result = sqlite_api::sqlite3_backup_step(backup, kPages);
    if (result == SQLITE_OK || result == SQLITE_BUSY || result == SQLITE_LOCKED) return false;
    if (result != SQLITE_DONE) fail(sqlite_api::sqlite3_errstr(result));
    const int finished = sqlite_api::sqlite3_backup_finish(backup);
    backup = nullptr;
    if (finished != SQLITE_OK) fail(sqlite_api::sqlite3_errstr(finished));
    return true;
  }
};

void Store::copy_to(const std::string& path) {
  const auto copy = std::make_shared<Copy>(path);
  std::future<void> done = copy->done.get_future();
  {
    const std::lock_guard lock(mutex_);
    if (stopping_ || failed_ || copy_)
      throw std::runtime_error("the database cannot be copied now: another copy is made, or it is closing");
    copy_ = copy;
  }
  wake_.notify_one();
  step_until_idle();
  done.get();
}

/// Tells whoever waits for it.
void Store::end_copy(std::exception_ptr error) {
  std::shared_ptr<Copy> copy;
  {
    const std::lock_guard lock(mutex_);
    copy = std::exchange(copy_, nullptr);
  }
  if (!copy) return;
  copy->close();
  if (error)
    copy->done.set_exception(error);
  else
    copy->done.set_value();
}

/// A copy that fails is no failure of the database.
void Store::step_copy() {
  std::shared_ptr<Copy> copy;
  bool stopping = false;
  {
    const std::lock_guard lock(mutex_);
    copy = copy_;
    stopping = stopping_;
  }
  if (!copy) return;
  std::exception_ptr error;
  try {
    if (stopping) copy->fail("the coordinator is stopping");
    if (!copy->backup) copy->begin(connection_of(*sql_));
    if (!copy->step()) return;
  } catch (const std::exception&) {
    error = std::current_exception();
  }
  end_copy(error);
}

}  // namespace woodcock::coordinator
