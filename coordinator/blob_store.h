// Files named by the SHA-256 of their content, in a folder: blobs/ab/abcd…, uploads in uploads/abcd….part.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>

#include "coordinator/digest_set.h"
#include "coordinator/failpoint.h"
#include "coordinator/model.h"

namespace woodcock::coordinator {

/// Why a blob operation failed; services map it to a status.
class BlobError : public std::runtime_error {
 public:
  enum class Kind { NoSpace, WrongOffset, Damaged, Busy, NotFound, Io };
  BlobError(Kind kind, const std::string& message) : std::runtime_error(message), kind_(kind) {}
  Kind kind() const { return kind_; }

 private:
  Kind kind_;
};

struct BlobStoreOptions {
  std::string dir;                    ///< made if absent
  int64_t min_free_bytes = 64 << 20;  ///< below this nothing is accepted and leasing pauses
  Time pin = 3600 * kSecond;          ///< how long blobs without a reference are kept after they were asked for
  Failpoint failpoint = [](const char*) {};
};

/// Safe to call from any thread. A blob that contains() names is complete, verified and durable.
class BlobStore {
 public:
  /// Makes the folders and removes temporary files of before. Throws BlobError.
  BlobStore(const BlobStoreOptions& options, Time now);

  bool contains(const std::string& digest) const;
  /// Size in bytes; nullopt if absent.
  std::optional<int64_t> size(const std::string& digest) const;
  std::string path(const std::string& digest) const;
  /// A name in the folder of temporary files, which is on the same file system and made again if it has gone.
  std::string temporary(const std::string& name) const;

  /// Keeps the blob until now + pin.
  void pin(const std::string& digest, Time now);
  Time pin_time() const { return options_.pin; }

  /// Bytes of the upload that are here, and whether the blob is complete.
  std::pair<int64_t, bool> upload_offset(const std::string& digest) const;

  /// One running upload; at most one for a digest. What arrived stays when it is destroyed.
  class Upload {
   public:
    ~Upload();
    Upload(const Upload&) = delete;
    Upload& operator=(const Upload&) = delete;
    /// Throws BlobError: NoSpace, Damaged (more than announced), Io.
    void append(std::string_view bytes, Time now);
    int64_t stored() const { return stored_; }
    /// When all bytes are here: verifies, makes durable, gives the blob its name, and returns true. Throws BlobError
    /// Damaged (the part is thrown away).
    bool finish(Time now);

   private:
    friend class BlobStore;
    struct State;
    Upload(BlobStore& store, std::string digest, int64_t total, int64_t offset);
    BlobStore& store_;
    std::string digest_, path_;
    int64_t total_, stored_ = 0;
    int fd_ = -1;
    std::unique_ptr<State> state_;
  };
  /// Throws BlobError: Busy, WrongOffset, NoSpace.
  std::unique_ptr<Upload> begin_upload(const std::string& digest, int64_t total, int64_t offset, Time now);

  /// Makes a finished temporary file a blob and returns its digest.
  std::string adopt(const std::string& temporary_path, Time now);
  std::string read(const std::string& digest, int64_t max_bytes) const;
  /// Reads the blob again: whether its content still has the digest. What cannot be read is damaged; `why`, if given, gets a
  /// sentence then.
  bool verify(const std::string& digest, std::string* why = nullptr) const;
  /// Throws away a blob that is damaged, whatever stands in its place.
  void remove(const std::string& digest) const;
  /// Removes blobs and partial uploads that are neither pinned nor referenced, and forgets pins that are over; returns how many went. What
  /// is not the store's is left alone, what cannot be read is passed over and told to `warn`.
  size_t sweep(
      const DigestSet& referenced, Time now, const std::function<void(const std::string&)>& warn = [](const std::string&) {});

  /// A sentence while there is too little room, else empty.
  std::string shortage() const;

 private:
  void check_room(int64_t bytes) const;
  void clear_the_way(const std::string& path) const;
  void ensure_folder(const std::string& path) const;
  void publish(const std::string& from, const std::string& digest, Time now, bool uploaded);

  const BlobStoreOptions options_;
  mutable std::mutex mutex_;
  mutable std::atomic<uint64_t> set_aside_{0};
  std::set<std::string> uploading_;   // guarded by mutex_
  std::map<std::string, Time> pins_;  // guarded by mutex_: kept until
  Time started_ = 0;
};

}  // namespace woodcock::coordinator
