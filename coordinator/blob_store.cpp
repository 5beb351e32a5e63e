#include "coordinator/blob_store.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>

#include "renderer/core/sha256.h"

namespace woodcock::coordinator {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void fail(const std::string& what, int error) {
  const auto kind = error == ENOSPC || error == EDQUOT || error == EFBIG ? BlobError::Kind::NoSpace : BlobError::Kind::Io;
  throw BlobError(kind, what + ": " + std::strerror(error));
}

void sync_path(const std::string& path, int flags) {
  const int fd = ::open(path.c_str(), flags | O_CLOEXEC);
  if (fd < 0) fail("opening " + path, errno);
  const int result = ::fsync(fd);
  const int error = errno;
  ::close(fd);
  if (result != 0) fail("fsync of " + path, error);
}

/// Feeds `hash` the first `limit` bytes of the file. Returns how many there were.
int64_t hash_file(const std::string& path, Sha256& hash, int64_t limit = INT64_MAX) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) fail("opening " + path, errno);
  constexpr int64_t kPiece = 1 << 16;
  const auto buffer = std::make_unique_for_overwrite<char[]>(kPiece);
  int64_t total = 0;
  while (total < limit) {
    const ssize_t n = ::read(fd, buffer.get(), static_cast<size_t>(std::min(kPiece, limit - total)));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      const int error = errno;
      ::close(fd);
      fail("reading " + path, error);
    }
    if (n == 0) break;
    hash.raw(buffer.get(), static_cast<size_t>(n));
    total += n;
  }
  ::close(fd);
  return total;
}

std::optional<int64_t> file_size(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  return status.st_size;
}

}  // namespace

struct BlobStore::Upload::State {
  Sha256 hash;
};

BlobStore::BlobStore(const BlobStoreOptions& options, Time now) : options_(options), started_(now) {
  clear_temporary();
  for (const char* name : {"/blobs", "/uploads"}) ensure_folder(options.dir + name);
}

void BlobStore::clear_temporary() const {
  std::error_code ignored;
  fs::remove_all(options_.dir + "/temporary", ignored);
  ensure_folder(options_.dir + "/temporary");
}

/// Moves what stands where a file or folder of ours belongs out of the way: a link, or a folder with anything in it. The folder of
/// temporary files is emptied at every start.
void BlobStore::clear_the_way(const std::string& path) const {
  std::error_code error;
  if (fs::symlink_status(path, error).type() == fs::file_type::not_found) return;
  fs::rename(path, options_.dir + "/temporary/set-aside-" + std::to_string(++set_aside_), error);
  if (error) fs::remove_all(path, error);
}

void BlobStore::ensure_folder(const std::string& path) const {
  std::error_code error;
  fs::create_directories(path, error);
  if (!error && fs::is_directory(path, error)) return;
  clear_the_way(path);
  fs::create_directories(path, error);
  if (error) throw BlobError(BlobError::Kind::Io, "cannot make the folder " + path + ": " + error.message());
}

std::string BlobStore::path(const std::string& digest) const { return options_.dir + "/blobs/" + digest.substr(0, 2) + "/" + digest; }
std::string BlobStore::temporary(const std::string& name) const {
  ensure_folder(options_.dir + "/temporary");
  return options_.dir + "/temporary/" + name;
}
std::optional<int64_t> BlobStore::size(const std::string& digest) const {
  {
    const std::lock_guard lock(mutex_);
    if (leaving_.contains(digest)) return std::nullopt;
  }
  return file_size(path(digest));
}
std::optional<int64_t> BlobStore::written_unix_ms(const std::string& digest) const {
  struct stat status {};
  if (::stat(path(digest).c_str(), &status) != 0) return std::nullopt;
  return int64_t{status.st_mtim.tv_sec} * 1000 + status.st_mtim.tv_nsec / 1'000'000;
}
bool BlobStore::contains(const std::string& digest) const { return size(digest).has_value(); }

void BlobStore::pin(const std::string& digest, Time now) {
  const std::lock_guard lock(mutex_);
  pins_[digest_prefix(digest)] = now + options_.pin;
}

void BlobStore::Hold::add(const std::string& digest) {
  const uint64_t prefix = digest_prefix(digest);
  prefixes_.push_back(prefix);
  const std::lock_guard lock(store_.mutex_);
  ++store_.holds_[prefix];
}

BlobStore::Hold::~Hold() {
  const std::lock_guard lock(store_.mutex_);
  for (const uint64_t prefix : prefixes_) {
    const auto it = store_.holds_.find(prefix);
    if (--it->second > 0) continue;
    store_.holds_.erase(it);
    store_.released_[prefix] = store_.marks_;
  }
}

std::string BlobStore::shortage() const {
  struct statvfs status {};
  if (::statvfs(options_.dir.c_str(), &status) != 0)
    return "the coordinator's disk cannot be examined: " + std::string(std::strerror(errno));
  const auto free = static_cast<int64_t>(status.f_bavail) * static_cast<int64_t>(status.f_frsize);
  if (free >= options_.min_free_bytes) return {};
  return "the coordinator's disk is full: " + std::to_string(free >> 20) + " MiB left, " + std::to_string(options_.min_free_bytes >> 20) +
         " MiB are kept free";
}

void BlobStore::check_room(int64_t bytes) const {
  struct statvfs status {};
  if (::statvfs(options_.dir.c_str(), &status) != 0) fail("examining the disk", errno);
  const auto free = static_cast<int64_t>(status.f_bavail) * static_cast<int64_t>(status.f_frsize);
  if (free - bytes < options_.min_free_bytes)
    throw BlobError(BlobError::Kind::NoSpace,
                    "the coordinator's disk has no room for " + std::to_string(bytes) + " bytes: try again later");
}

std::pair<int64_t, bool> BlobStore::upload_offset(const std::string& digest) const {
  if (const auto complete = size(digest)) return {*complete, true};
  return {file_size(options_.dir + "/uploads/" + digest + ".part").value_or(0), false};
}

std::unique_ptr<BlobStore::Upload> BlobStore::begin_upload(const std::string& digest, int64_t total, int64_t offset, Time now) {
  {
    const std::lock_guard lock(mutex_);
    if (!uploading_.insert(digest).second) throw BlobError(BlobError::Kind::Busy, "another upload of this blob is running");
    pins_[digest_prefix(digest)] = now + options_.pin;
  }
  std::unique_ptr<Upload> upload;
  try {
    check_room(total - offset);
    upload.reset(new Upload(*this, digest, total, offset));
  } catch (...) {
    const std::lock_guard lock(mutex_);
    uploading_.erase(digest);
    throw;
  }
  return upload;
}

BlobStore::Upload::Upload(BlobStore& store, std::string digest, int64_t total, int64_t offset)
    : store_(store),
      digest_(std::move(digest)),
      path_(store.options_.dir + "/uploads/" + digest_ + ".part"),
      total_(total),
      state_(std::make_unique<State>()) {
  store_.ensure_folder(store_.options_.dir + "/uploads");
  const std::optional<int64_t> size = file_size(path_);
  if (!size) store_.clear_the_way(path_);
  const int64_t there = size.value_or(0);
  // Offset 0 begins again, whatever is there.
  if (offset != 0 && offset != there)
    throw BlobError(BlobError::Kind::WrongOffset,
                    "the stored part ends at byte " + std::to_string(there) + ", not at " + std::to_string(offset));
  if (offset > 0) hash_file(path_, state_->hash, offset);
  fd_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | (offset == 0 ? O_TRUNC : 0), 0644);
  if (fd_ < 0) fail("opening " + path_, errno);
  stored_ = offset;
}

BlobStore::Upload::~Upload() {
  if (fd_ >= 0) ::close(fd_);
  const std::lock_guard lock(store_.mutex_);
  store_.uploading_.erase(digest_);
}

void BlobStore::Upload::append(std::string_view bytes, Time now) {
  if (stored_ + static_cast<int64_t>(bytes.size()) > total_) {
    ::unlink(path_.c_str());
    throw BlobError(BlobError::Kind::Damaged, "more bytes than announced");
  }
  while (!bytes.empty()) {
    const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) fail("writing the upload", errno);
    state_->hash.raw(bytes.data(), static_cast<size_t>(n));
    stored_ += n;
    bytes.remove_prefix(static_cast<size_t>(n));
  }
  store_.pin(digest_, now);
}

bool BlobStore::Upload::finish(Time now) {
  if (stored_ < total_) return false;
  if (state_->hash.hex() != digest_) {
    ::unlink(path_.c_str());
    throw BlobError(BlobError::Kind::Damaged, "the content does not have the digest; the part was thrown away");
  }
  store_.options_.failpoint("upload-written");  // an uploaded blob is whole, nothing of it durable
  store_.publish(path_, digest_, now, true);
  return true;
}

/// temporary file → fsync → rename → fsync of the directory.
void BlobStore::publish(const std::string& from, const std::string& digest, Time now, bool uploaded) {
  sync_path(from, O_RDONLY);
  if (uploaded)
    options_.failpoint("upload-synced");  // it is on disk under its temporary name
  else
    options_.failpoint("image-synced");  // an image is
  const std::string to = path(digest), folder = options_.dir + "/blobs/" + digest.substr(0, 2);
  std::error_code error;
  if (!fs::is_directory(folder, error)) {
    ensure_folder(folder);
    sync_path(options_.dir + "/blobs", O_RDONLY | O_DIRECTORY);
  }
  if (fs::is_directory(to, error)) clear_the_way(to);
  // Before it has its name: a clean-up must not find it without.
  pin(digest, now);
  {
    std::unique_lock lock(mutex_);
    left_.wait(lock, [&] { return !leaving_.contains(digest); });
  }
  if (::rename(from.c_str(), to.c_str()) != 0) fail("renaming " + from, errno);
  if (uploaded)
    options_.failpoint("upload-renamed");  // it has its name, the folder is not synced
  else
    options_.failpoint("image-renamed");
  sync_path(folder, O_RDONLY | O_DIRECTORY);
  if (uploaded) options_.failpoint("upload-published");  // it is a blob, who uploaded it does not know
}

std::string BlobStore::adopt(const std::string& temporary_path, Time now) {
  Sha256 hash;
  hash_file(temporary_path, hash);
  const std::string digest = hash.hex();
  publish(temporary_path, digest, now, false);
  return digest;
}

std::string BlobStore::read(const std::string& digest, int64_t max_bytes) const {
  const auto bytes = size(digest);
  if (!bytes) throw BlobError(BlobError::Kind::NotFound, "there is no blob " + digest);
  if (*bytes > max_bytes) throw BlobError(BlobError::Kind::Damaged, "blob " + digest + " is larger than allowed here");
  std::string content(static_cast<size_t>(*bytes), '\0');
  const int fd = ::open(path(digest).c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) fail("opening blob " + digest, errno);
  size_t done = 0;
  while (done < content.size()) {
    const ssize_t n = ::read(fd, content.data() + done, content.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) break;
    done += static_cast<size_t>(n);
  }
  ::close(fd);
  if (Sha256().raw(content.data(), done).hex() != digest)
    throw BlobError(BlobError::Kind::Damaged, "blob " + digest + " is damaged at rest");
  return content;
}

bool BlobStore::verify(const std::string& digest, std::string* why) const {
  std::string reason = "the file " + path(digest) + " is gone";
  if (contains(digest)) {
    try {
      Sha256 hash;
      hash_file(path(digest), hash);
      if (hash.hex() == digest) return true;
      reason = "the content of " + path(digest) + " is not that of its digest";
    } catch (const BlobError& error) {
      reason = error.what();
    }
  }
  if (why) *why = reason;
  return false;
}

void BlobStore::remove(const std::string& digest) const {
  if (::unlink(path(digest).c_str()) != 0 && errno != ENOENT) clear_the_way(path(digest));
}

namespace {

/// The names in a folder. What cannot be read is told to `warn`; a folder that is not there is empty.
std::vector<fs::path> names_in(const fs::path& folder, const std::function<void(const std::string&)>& warn) {
  std::vector<fs::path> paths;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) paths.push_back(it->path());
  if (error && error != std::errc::no_such_file_or_directory) warn("the folder " + folder.string() + " cannot be read: " + error.message());
  return paths;
}

}  // namespace

bool is_hexadecimal(const std::string& name, size_t length) {
  return name.size() == length && name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

BlobStore::Mark BlobStore::begin_mark(Time now) {
  const std::lock_guard lock(mutex_);
  return {now, ++marks_};
}

/// Decides under the mutex and removes without it: nobody waits for the disk who only pins.
bool BlobStore::remove_unless_kept(const std::string& digest, const std::string& path, const Mark& mark) {
  {
    const std::lock_guard lock(mutex_);
    const uint64_t prefix = digest_prefix(digest);
    const auto pin = pins_.find(prefix);
    const auto released = released_.find(prefix);
    if (uploading_.contains(digest) || holds_.contains(prefix) || (pin != pins_.end() && pin->second > mark.now) ||
        (released != released_.end() && released->second >= mark.number))
      return false;
    if (!leaving_.insert(digest).second) return false;  // another clean-up removes it
  }
  const bool removed = ::unlink(path.c_str()) == 0;
  {
    const std::lock_guard lock(mutex_);
    leaving_.erase(digest);
  }
  left_.notify_all();
  return removed;
}

void BlobStore::each_blob(const std::function<void(const std::string&)>& use_blob, const Warn& warn) const {
  // Where blobs are a volume of its own, its lost+found lies among them.
  for (const fs::path& folder : names_in(options_.dir + "/blobs", warn)) {
    if (!is_hexadecimal(folder.filename(), 2)) continue;
    for (const fs::path& path : names_in(folder, warn))
      if (is_hexadecimal(path.filename(), 64)) use_blob(path.filename());
  }
}

int64_t BlobStore::bytes(const DigestSet& referenced, const Warn& warn) const {
  int64_t total = 0;
  each_blob(
      [&](const std::string& digest) {
        if (referenced.may_contain(digest)) total += file_size(path(digest)).value_or(0);
      },
      warn);
  return total;
}

size_t BlobStore::sweep(const DigestSet& referenced, const Mark& mark, const Warn& warn, int64_t keep_before_unix_ms) {
  // Pins are not remembered over a restart: then everything counts as pinned when the coordinator started.
  if (mark.now - started_ < options_.pin) return 0;
  size_t removed = 0;
  each_blob(
      [&](const std::string& digest) {
        if (referenced.may_contain(digest)) return;
        if (keep_before_unix_ms > 0 && written_unix_ms(digest).value_or(0) < keep_before_unix_ms) return;
        removed += remove_unless_kept(digest, path(digest), mark);
      },
      warn);
  for (const fs::path& path : names_in(options_.dir + "/uploads", warn)) removed += remove_unless_kept(path.stem(), path, mark);
  const std::lock_guard lock(mutex_);
  std::erase_if(pins_, [&](const auto& pin) { return pin.second <= mark.now; });
  std::erase_if(released_, [&](const auto& released) { return released.second < mark.number; });
  return removed;
}

}  // namespace woodcock::coordinator
