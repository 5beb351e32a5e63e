#include "rpc/blob_transfer.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <random>
#include <system_error>
#include <thread>

#include "renderer/core/sha256.h"
#include "rpc/channel.h"
#include "rpc/limits.h"
#include "rpc/manifest.h"
#include "rpc/status.h"

namespace woodcock::rpc {
namespace {

constexpr int kAttempts = 5;
/// A stream slower than this is broken off, and resumed by the next attempt.
constexpr int64_t kSlowestBytesPerSecond = 64 << 10;

class File {
 public:
  File(const std::string& path, int flags) : path_(path), fd_(::open(path.c_str(), flags | O_CLOEXEC, 0644)) {
    if (fd_ < 0) fail("open");
  }
  ~File() { ::close(fd_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;

  int64_t size() const {
    struct stat status {};
    if (::fstat(fd_, &status) != 0) fail("stat");
    return status.st_size;
  }
  size_t read_at(char* data, size_t size, int64_t offset) const {
    ssize_t n;
    do n = ::pread(fd_, data, size, offset);
    while (n < 0 && errno == EINTR);
    if (n < 0) fail("read");
    return static_cast<size_t>(n);
  }
  void append(const std::string& bytes) const {
    for (size_t done = 0; done < bytes.size();) {
      const ssize_t n = ::write(fd_, bytes.data() + done, bytes.size() - done);
      if (n < 0 && errno != EINTR) fail("write");
      if (n > 0) done += static_cast<size_t>(n);
    }
  }
  void sync() const {
    if (::fsync(fd_) != 0) fail("fsync");
  }

 private:
  [[noreturn]] void fail(const char* what) const {
    throw std::system_error(errno, std::generic_category(), std::string(what) + " " + path_);
  }
  std::string path_;
  int fd_;
};

void check_stop(const TransferControl& control) {
  if (control.stop && control.stop()) throw RpcError(Code::kCancelled, "the transfer was stopped");
}

/// Waits 0.2 s · 2^attempt, jittered, in small steps so that a stop is seen.
void back_off(int attempt, const TransferControl& control) {
  thread_local std::minstd_rand random{std::random_device{}()};
  const double seconds = 0.2 * static_cast<double>(1 << std::min(attempt, 5)) * std::uniform_real_distribution<>(0.5, 1.0)(random);
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) {
    check_stop(control);
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

std::chrono::milliseconds stream_deadline(int64_t bytes) {
  return kChunkDeadline + std::chrono::milliseconds(bytes * 1000 / kSlowestBytesPerSecond);
}

/// Repeats `attempt(reached, status)` until it returns true. It says how far it got, so that progress renews the attempts.
template <typename Attempt>
void repeat(const TransferControl& control, const Attempt& attempt) {
  int64_t best = -1;
  for (int failures = 0;;) {
    check_stop(control);
    int64_t reached = 0;
    grpc::Status status;
    if (attempt(reached, status)) return;
    // A stream that gave its place up to others is CANCELLED.
    const bool again = is_retryable(status) || status.error_code() == grpc::StatusCode::CANCELLED;
    if (!again && status.error_code() != grpc::StatusCode::OUT_OF_RANGE) throw_if_failed(status, "blob transfer");
    if (reached > best) {
      best = reached;
      failures = 0;
    }
    if (++failures >= kAttempts) throw_if_failed(status, "blob transfer, given up after 5 attempts");
    back_off(failures, control);
  }
}

/// `read(data, size, offset)` gives the bytes to send.
template <typename Read>
void upload(v1::BlobsService::StubInterface& blobs, const std::string& digest, int64_t total, const Read& read,
            const TransferControl& control) {
  repeat(control, [&](int64_t& reached, grpc::Status& status) {
    v1::QueryUploadRequest query;
    v1::QueryUploadResponse state;
    query.set_content_digest(digest);
    grpc::ClientContext query_context;
    set_deadline(query_context, kCallDeadline);
    status = blobs.QueryUpload(&query_context, query, &state);
    if (!status.ok()) return false;
    if (state.complete()) return true;
    reached = state.offset_bytes();

    grpc::ClientContext context;
    set_deadline(context, stream_deadline(total - reached));
    v1::UploadResponse response;
    const auto writer = blobs.Upload(&context, &response);
    v1::UploadRequest request;
    request.mutable_header()->set_content_digest(digest);
    request.mutable_header()->set_total_bytes(total);
    request.mutable_header()->set_offset_bytes(reached);
    bool open = writer->Write(request);
    for (int64_t offset = reached; open && offset < total;) {
      if (control.stop && control.stop()) {
        context.TryCancel();
        break;
      }
      std::string& chunk = *request.mutable_chunk();
      chunk.resize(static_cast<size_t>(std::min<int64_t>(kChunkBytes, total - offset)));
      chunk.resize(read(chunk.data(), chunk.size(), offset));
      if (chunk.empty()) {
        context.TryCancel();
        writer->Finish();
        throw RpcError(Code::kDataLoss, "the file of blob " + digest + " became shorter while it was uploaded");
      }
      offset += static_cast<int64_t>(chunk.size());
      open = writer->Write(request);
      if (open && control.progress) control.progress(offset);
    }
    if (open) writer->WritesDone();
    status = writer->Finish();
    if (!status.ok()) return false;
    reached = response.stored_bytes();
    if (!response.complete()) status = {grpc::StatusCode::UNAVAILABLE, "the coordinator has a part of the blob only"};
    return response.complete();
  });
}

}  // namespace

std::vector<std::string> find_missing(v1::BlobsService::StubInterface& blobs, const std::vector<std::string>& digests) {
  std::vector<std::string> missing;
  for (size_t begin = 0; begin < digests.size(); begin += kMaxDigestsPerCall) {
    v1::FindMissingRequest request;
    for (size_t i = begin; i < std::min(begin + kMaxDigestsPerCall, digests.size()); ++i) request.add_digests(digests[i]);
    v1::FindMissingResponse response;
    repeat({}, [&](int64_t&, grpc::Status& status) {
      grpc::ClientContext context;
      set_deadline(context, kCallDeadline);
      status = blobs.FindMissing(&context, request, &response);
      return status.ok();
    });
    missing.insert(missing.end(), response.missing_digests().begin(), response.missing_digests().end());
  }
  return missing;
}

void upload_file(v1::BlobsService::StubInterface& blobs, const std::string& path, const std::string& digest,
                 const TransferControl& control) {
  const File file(path, O_RDONLY);
  upload(
      blobs, digest, file.size(), [&](char* data, size_t size, int64_t offset) { return file.read_at(data, size, offset); }, control);
}

std::string upload_bytes(v1::BlobsService::StubInterface& blobs, const std::string& bytes, const TransferControl& control) {
  const std::string digest = blob_digest(bytes);
  upload(
      blobs, digest, static_cast<int64_t>(bytes.size()),
      [&](char* data, size_t size, int64_t offset) { return bytes.copy(data, size, static_cast<size_t>(offset)); }, control);
  return digest;
}

void download_file(v1::BlobsService::StubInterface& blobs, const std::string& digest, const std::string& path, bool durable,
                   const TransferControl& control) {
  const std::string part_path = path + ".part";
  bool started_again = false;
  repeat(control, [&](int64_t& reached, grpc::Status& status) {
    const File part(part_path, O_RDWR | O_CREAT | O_APPEND);
    reached = part.size();
    Sha256 hash;
    std::string buffer(kChunkBytes, '\0');
    for (int64_t offset = 0; offset < reached;) {
      const size_t n = part.read_at(buffer.data(), buffer.size(), offset);
      if (n == 0) break;
      hash.raw(buffer.data(), n);
      offset += static_cast<int64_t>(n);
    }
    v1::DownloadRequest request;
    request.set_content_digest(digest);
    request.set_offset_bytes(reached);
    grpc::ClientContext context;
    // The size is not known before the first message; the largest blob sets the bound, a stop ends it earlier.
    set_deadline(context, stream_deadline(kMaxBlobBytes / 64));
    const auto reader = blobs.Download(&context, request);
    v1::DownloadResponse response;
    int64_t total = -1;
    while (reader->Read(&response)) {
      if (total < 0) total = response.total_bytes();
      if (control.stop && control.stop()) context.TryCancel();
      part.append(response.chunk());
      hash.raw(response.chunk().data(), response.chunk().size());
      reached += static_cast<int64_t>(response.chunk().size());
      if (control.progress) control.progress(reached);
    }
    status = reader->Finish();
    if (status.error_code() == grpc::StatusCode::OUT_OF_RANGE) ::unlink(part_path.c_str());
    if (!status.ok()) return false;
    if (hash.hex() != digest) {
      ::unlink(part_path.c_str());
      const bool again = !std::exchange(started_again, true);
      status = {again ? grpc::StatusCode::UNAVAILABLE : grpc::StatusCode::DATA_LOSS, "blob " + digest + " arrived damaged"};
      return false;
    }
    if (durable) part.sync();
    std::filesystem::rename(part_path, path);
    if (durable) File(std::filesystem::path(path).parent_path().string() + "/", O_RDONLY | O_DIRECTORY).sync();
    return true;
  });
}

std::string download_bytes(v1::BlobsService::StubInterface& blobs, const std::string& digest, int64_t max_bytes) {
  std::string bytes;
  repeat({}, [&](int64_t&, grpc::Status& status) {
    bytes.clear();
    v1::DownloadRequest request;
    request.set_content_digest(digest);
    grpc::ClientContext context;
    set_deadline(context, stream_deadline(max_bytes));
    const auto reader = blobs.Download(&context, request);
    v1::DownloadResponse response;
    bool too_large = false;
    while (reader->Read(&response)) {
      too_large = too_large || static_cast<int64_t>(bytes.size() + response.chunk().size()) > max_bytes;
      if (too_large) {
        context.TryCancel();
      } else {
        bytes += response.chunk();
      }
    }
    status = reader->Finish();
    if (too_large) fail_exhausted("blob " + digest + " is larger than expected");
    if (status.ok() && blob_digest(bytes) != digest) status = {grpc::StatusCode::DATA_LOSS, "blob " + digest + " arrived damaged"};
    return status.ok();
  });
  return bytes;
}

}  // namespace woodcock::rpc
