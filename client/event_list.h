// What happened to a job, event by event.
#pragma once

#include <cstdint>
#include <string>

#include "client/service.h"

namespace woodcock {

/// "2026-11-30 18:40:29Z" of milliseconds since 1970.
std::string utc_time(int64_t unix_ms);

/// Prints the events of a job after a number, page by page: a line each, or one JSON object. Throws rpc::RpcError.
void print_events(Service& service, const std::string& job_id, int64_t after, bool json);

}  // namespace woodcock
