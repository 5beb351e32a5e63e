// The list of files that a frame needs, as a blob.
#pragma once

#include <string>
#include <string_view>

#include "woodcock/v1/common.pb.h"

namespace woodcock::rpc {

/// Whether `path` stays inside the folder it is relative to: '/'-separated, no empty, '.' or '..' name, no backslash or
/// control character, not absolute, at most kMaxPathBytes.
bool is_safe_path(std::string_view path);

/// Sorts the files by path and serializes them: equal manifests give equal bytes, whose digest names the blob. Throws RpcError
/// INVALID_ARGUMENT where a path is not UTF-8.
std::string serialize_manifest(v1::SceneManifest manifest);

/// The inverse. Throws RpcError INVALID_ARGUMENT on malformed bytes, unsafe or repeated paths, malformed digests, negative
/// sizes, or more than kMaxManifestFiles files.
v1::SceneManifest parse_manifest(const std::string& bytes);

/// The content's digest, as blobs are named: SHA-256 of the plain bytes.
std::string blob_digest(std::string_view bytes);

}  // namespace woodcock::rpc
