// The caller's side of BlobsService: uploads and downloads that resume, retry with backoff, and verify.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "woodcock/v1/blobs_service.grpc.pb.h"

namespace woodcock::rpc {

/// Lets a transfer wait and give up: `stop()` true ends it with CANCELLED. Both may be empty.
struct TransferControl {
  std::function<bool()> stop;
  std::function<void(int64_t bytes_done)> progress;
};

/// The digests of `digests` that the coordinator lacks, asked in as many calls as needed. The others are pinned.
std::vector<std::string> find_missing(v1::BlobsService::StubInterface& blobs, const std::vector<std::string>& digests);

/// Uploads the file at `path`, whose content has `digest`; returns when it is durable there. Resumes where an earlier
/// upload ended. Throws RpcError after five attempts in a row without progress, or at once when repeating cannot help;
/// std::system_error when the file cannot be read.
void upload_file(v1::BlobsService::StubInterface& blobs, const std::string& path, const std::string& digest,
                 const TransferControl& control = {});

/// The same for bytes in memory. Returns their digest.
std::string upload_bytes(v1::BlobsService::StubInterface& blobs, const std::string& bytes, const TransferControl& control = {});

/// Downloads a blob to `path` by way of `path`.part, which a broken download leaves and the next one resumes. The file
/// appears at `path` only when its digest is verified; it is durable if `durable`. Throws RpcError as above; DATA_LOSS
/// when the content is wrong even after starting again; std::system_error when it cannot be written.
void download_file(v1::BlobsService::StubInterface& blobs, const std::string& digest, const std::string& path, bool durable = false,
                   const TransferControl& control = {});

/// A blob of at most `max_bytes` into memory. Throws RpcError; RESOURCE_EXHAUSTED when it is larger.
std::string download_bytes(v1::BlobsService::StubInterface& blobs, const std::string& digest, int64_t max_bytes);

}  // namespace woodcock::rpc
