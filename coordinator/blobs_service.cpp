#include <fcntl.h>
#include <unistd.h>

#include "coordinator/services.h"
#include "renderer/core/sha256.h"
#include "rpc/convert.h"
#include "rpc/limits.h"
#include "rpc/status.h"

namespace woodcock::coordinator {
namespace {

grpc::StatusCode code_of(BlobError::Kind kind) {
  switch (kind) {
    case BlobError::Kind::NoSpace:
      return grpc::StatusCode::RESOURCE_EXHAUSTED;
    case BlobError::Kind::WrongOffset:
      return grpc::StatusCode::OUT_OF_RANGE;
    case BlobError::Kind::Damaged:
      return grpc::StatusCode::DATA_LOSS;
    case BlobError::Kind::Busy:
      return grpc::StatusCode::ABORTED;
    case BlobError::Kind::NotFound:
      return grpc::StatusCode::NOT_FOUND;
    case BlobError::Kind::Io:
      return grpc::StatusCode::INTERNAL;
  }
  return grpc::StatusCode::INTERNAL;
}

template <typename Work>
grpc::Status answer(Work work) {
  try {
    work();
    return grpc::Status::OK;
  } catch (const BlobError& error) {
    return {code_of(error.kind()), error.what()};
  } catch (...) {
    return rpc::status_of_current_exception();
  }
}

}  // namespace

BlobsService::BlobsService(Coordinator& coordinator, const StreamPlacesOptions& places)
    : coordinator_(coordinator), uploads_("uploads", places), downloads_("downloads", places) {}

grpc::Status BlobsService::FindMissing(grpc::ServerContext*, const v1::FindMissingRequest* request, v1::FindMissingResponse* response) {
  return answer([&] {
    if (static_cast<size_t>(request->digests_size()) > rpc::kMaxDigestsPerCall) rpc::fail_invalid("digests: at most 10000 in one call");
    for (const std::string& digest : request->digests()) {
      rpc::checked_digest(digest, "digests");
      // Pinned before it is looked for: a clean-up in between must not take it.
      coordinator_.blobs().pin(digest, coordinator_.now());
      if (!coordinator_.blobs().contains(digest)) response->add_missing_digests(digest);
    }
    response->set_pin_ms(coordinator_.blobs().pin_time() / 1'000'000);
  });
}

grpc::Status BlobsService::QueryUpload(grpc::ServerContext*, const v1::QueryUploadRequest* request, v1::QueryUploadResponse* response) {
  return answer([&] {
    coordinator_.blobs().pin(rpc::checked_digest(request->content_digest(), "content_digest"), coordinator_.now());
    const auto [offset, complete] = coordinator_.blobs().upload_offset(request->content_digest());
    response->set_offset_bytes(offset);
    response->set_complete(complete);
  });
}

std::unique_ptr<BlobStore::Upload> BlobsService::begin_upload(const v1::UploadHeader& header) {
  const auto begin = [&] {
    return coordinator_.blobs().begin_upload(header.content_digest(), header.total_bytes(), header.offset_bytes(), coordinator_.now());
  };
  try {
    return begin();
  } catch (const BlobError& error) {
    // Who sends the same file and does not move must not keep others from it.
    if (error.kind() != BlobError::Kind::Busy || !uploads_.make_way(header.content_digest())) throw;
  }
  return begin();
}

grpc::Status BlobsService::Upload(grpc::ServerContext* context, grpc::ServerReader<v1::UploadRequest>* reader,
                                  v1::UploadResponse* response) {
  return answer([&] {
    StreamPlaces::Place place(uploads_, [context] { context->TryCancel(); });
    v1::UploadRequest request;
    if (!reader->Read(&request) || !request.has_header()) rpc::fail_invalid("an upload begins with its header");
    const v1::UploadHeader header = request.header();
    const std::string& digest = rpc::checked_digest(header.content_digest(), "content_digest");
    if (header.total_bytes() < 0 || header.total_bytes() > rpc::kMaxBlobBytes) rpc::fail_invalid("total_bytes: expected 0 to 64 GiB");
    if (header.offset_bytes() < 0 || header.offset_bytes() > header.total_bytes())
      rpc::fail_invalid("offset_bytes: expected 0 to total_bytes");
    BlobStore& blobs = coordinator_.blobs();
    // Pinned before it is looked for: a clean-up in between must not take it.
    blobs.pin(digest, coordinator_.now());
    if (const auto size = blobs.size(digest)) {
      response->set_stored_bytes(*size);
      response->set_complete(true);
      return;
    }
    place.works();
    const auto upload = begin_upload(header);
    place.holds(digest);
    place.moved(0);
    while (reader->Read(&request)) {
      place.works();
      if (!request.has_chunk() || request.chunk().empty() || request.chunk().size() > rpc::kChunkBytes)
        rpc::fail_invalid("chunk: expected 1 byte to 1 MiB");
      upload->append(request.chunk(), coordinator_.now());
      place.moved(static_cast<int64_t>(request.chunk().size()));
    }
    if (const std::string why = place.ended(); !why.empty()) throw rpc::RpcError(rpc::Code::kDeadlineExceeded, why);
    place.works();
    response->set_complete(upload->finish(coordinator_.now()));
    response->set_stored_bytes(upload->stored());
  });
}

grpc::Status BlobsService::Download(grpc::ServerContext* context, const v1::DownloadRequest* request,
                                    grpc::ServerWriter<v1::DownloadResponse>* writer) {
  return answer([&] {
    StreamPlaces::Place place(downloads_, [context] { context->TryCancel(); });
    place.works();
    BlobStore& blobs = coordinator_.blobs();
    const std::string& digest = rpc::checked_digest(request->content_digest(), "content_digest");
    blobs.pin(digest, coordinator_.now());
    const std::optional<int64_t> size = blobs.size(digest);
    if (!size) {
      coordinator_.blob_lost(digest);
      rpc::fail_not_found("there is no blob " + digest);
    }
    int64_t offset = request->offset_bytes();
    if (offset < 0 || offset > *size) throw rpc::RpcError(rpc::Code::kOutOfRange, "the blob has " + std::to_string(*size) + " bytes");
    const int fd = ::open(blobs.path(digest).c_str(), O_RDONLY | O_CLOEXEC);
    if (fd < 0) {
      coordinator_.blob_lost(digest);
      rpc::fail_not_found("there is no blob " + digest);
    }
    v1::DownloadResponse response;
    response.set_total_bytes(*size);
    std::string& chunk = *response.mutable_chunk();
    bool open = true, failed = false;
    // A reader that goes on in the middle checks the whole itself, and begins again where it does not hold.
    const bool whole = offset == 0;
    Sha256 hash;
    // An empty blob has one empty message.
    do {
      chunk.resize(rpc::kChunkBytes / 2);
      const ssize_t n = ::pread(fd, chunk.data(), chunk.size(), offset);
      failed = n < 0 || (n == 0 && offset < *size);
      if (failed) break;
      chunk.resize(static_cast<size_t>(n));
      offset += n;
      if (whole) hash.raw(chunk.data(), chunk.size());
      place.moved(n);
      open = writer->Write(response);
      place.works();
      response.clear_total_bytes();
    } while (open && offset < *size);
    ::close(fd);
    if (failed || (open && whole && hash.hex() != digest)) {
      coordinator_.blob_lost(digest);
      throw rpc::RpcError(rpc::Code::kDataLoss, "blob " + digest + " is damaged on the coordinator's disk");
    }
  });
}

}  // namespace woodcock::coordinator
