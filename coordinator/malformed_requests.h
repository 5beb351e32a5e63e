// Requests that cannot be parsed.
#pragma once

#include <grpcpp/server_builder.h>

namespace woodcock::coordinator {

/// Makes the server answer them with INVALID_ARGUMENT and the field that is not UTF-8, in the place of gRPC's INTERNAL without a word.
void explain_malformed_requests(grpc::ServerBuilder& builder);

}  // namespace woodcock::coordinator
