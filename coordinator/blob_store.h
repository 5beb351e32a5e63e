// Files named by the SHA-256 of their content, in a folder: blobs/ab/abcd…, uploads in uploads/abcd….part.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

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

/// Whether it is so many hexadecimal digits, as the names of blobs (64) and of their folders (2) are.
bool is_hexadecimal(const std::string& name, size_t length);

/// Safe to call from any thread. A blob that contains() names is complete, verified and durable.
class BlobStore {
 public:
  /// Makes the folders and removes temporary files of before. Throws BlobError.
  BlobStore(const BlobStoreOptions& options, Time now);

  bool contains(const std::string& digest) const;
  /// Size in bytes; nullopt if absent.
  std::optional<int64_t> size(const std::string& digest) const;
  /// When its file was written, by the clock of the file system; nullopt if absent.
  std::optional<int64_t> written_unix_ms(const std::string& digest) const;
  std::string path(const std::string& digest) const;
  /// A name in the folder of temporary files, which is on the same file system and made again if it has gone.
  std::string temporary(const std::string& name) const;
  /// When nobody writes there. Throws BlobError.
  void clear_temporary() const;

  /// Keeps the blob until now + pin. What is pinned, or held, before one asks whether it is here stays.
  void pin(const std::string& digest, Time now);
  Time pin_time() const { return options_.pin; }

  /// Keeps blobs as long as it lives, whatever the time: from the moment when one asks whether they are here until the row that
  /// refers to them is durable. A clean-up that began before its end keeps them, too.
  class Hold {
   public:
    explicit Hold(BlobStore& store) : store_(store) {}
    ~Hold();
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;
    void add(const std::string& digest);

   private:
    BlobStore& store_;
    std::vector<uint64_t> prefixes_;
  };

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
  using Warn = std::function<void(const std::string&)>;
  /// When one began to look for what is referenced.
  struct Mark {
    Time now = 0;
    uint64_t number = 0;
  };
  Mark begin_mark(Time now);
  /// Removes blobs and partial uploads that are neither pinned nor held nor referenced, and forgets pins that are over; returns how many
  /// went. What was pinned or held at any time since `mark` stays: a row that refers to it may have come after one looked. What is not the
  /// store's is left alone, what cannot be read is passed over and told to `warn`. Blobs that were written before `keep_before_unix_ms`
  /// stay whatever refers to them.
  size_t sweep(
      const DigestSet& referenced, const Mark& mark, const Warn& warn = [](const std::string&) {}, int64_t keep_before_unix_ms = 0);
  size_t sweep(const DigestSet& referenced, Time now) { return sweep(referenced, begin_mark(now)); }
  /// Bytes of the blobs that `referenced` has.
  int64_t bytes(
      const DigestSet& referenced, const Warn& warn = [](const std::string&) {}) const;
  /// Calls `use_blob` with the digest of each blob. What cannot be read is passed over.
  void each_blob(const std::function<void(const std::string&)>& use_blob, const Warn& warn) const;

  /// A sentence while there is too little room, else empty.
  std::string shortage() const;

 private:
  void check_room(int64_t bytes) const;
  bool remove_unless_kept(const std::string& digest, const std::string& path, const Mark& mark);
  void clear_the_way(const std::string& path) const;
  void ensure_folder(const std::string& path) const;
  void publish(const std::string& from, const std::string& digest, Time now, bool uploaded);

  const BlobStoreOptions options_;
  mutable std::mutex mutex_;
  mutable std::atomic<uint64_t> set_aside_{0};
  std::condition_variable left_;
  // Guarded by mutex_. Digests that are many are known by their first 64 bits: another one may be kept with them, none is lost.
  std::set<std::string> uploading_;
  std::unordered_map<uint64_t, Time> pins_;          ///< kept until
  std::unordered_map<uint64_t, int> holds_;          ///< how many hold it
  std::unordered_map<uint64_t, uint64_t> released_;  ///< the number of marks that had begun when the last hold ended
  std::set<std::string> leaving_;                    ///< being removed: not here any more
  uint64_t marks_ = 0;
  const Time started_;
};

}  // namespace woodcock::coordinator
