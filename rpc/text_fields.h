// Strings of a message that protobuf would not carry.
#pragma once

#include <google/protobuf/message.h>

namespace woodcock::rpc {

/// Throws RpcError INVALID_ARGUMENT that names the field, e.g. "frames[2].scene_file", where a string of the message is not UTF-8. The
/// peer could not read the message at all, and would say no more than INTERNAL.
void check_text_fields(const google::protobuf::Message& message);

}  // namespace woodcock::rpc
