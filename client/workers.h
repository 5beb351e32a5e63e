// The workers of a coordinator.
#pragma once

#include <vector>

#include "client/service.h"
#include "woodcock/v1/worker_status.pb.h"

namespace woodcock {

/// All that are connected, by id. Throws rpc::RpcError.
std::vector<v1::WorkerStatus> list_workers(Service& service);

}  // namespace woodcock
