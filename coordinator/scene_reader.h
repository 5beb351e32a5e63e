// Scenes that are handed in as files: read in a child process, since they are not trusted and this program has no reader of scenes.
#pragma once

#include <string>

#include "coordinator/blob_store.h"
#include "woodcock/v1/scenes_service.pb.h"

namespace woodcock::coordinator {

/// Fills in what SubmitSceneRequest leaves out: `resolved` and `warnings` of the response, a job that can be submitted. Files and
/// manifests that it names are blobs then, pinned. `program` is `woodcock`. Blocks for as long as the scene takes to read, two minutes at
/// most. Throws RpcError: what is wrong with the request or with the scene, in the reader's words.
v1::SubmitSceneResponse read_handed_in_scene(const v1::SubmitSceneRequest& request, const std::string& program, BlobStore& blobs, Time now);

}  // namespace woodcock::coordinator
