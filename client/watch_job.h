// Following a job to its end.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "client/service.h"

namespace woodcock {

/// Called with what is new: events in order, none left out or repeated, and the job without its frames.
using JobUpdate = std::function<void(const v1::WatchJobResponse& update)>;

/// Follows the job until it has ended; nullopt when interrupted (Ctrl-C). Lives through restarts of the coordinator;
/// throws rpc::RpcError when it stays away for five minutes, or does not know the job.
std::optional<v1::Job> watch_job(Service& service, const std::string& job_id, const JobUpdate& update);

/// The same with a progress bar or lines on standard error, and a line for each event that a user should know of.
/// `quiet` shows nothing.
std::optional<v1::Job> watch_job_on_terminal(Service& service, const std::string& job_id, bool quiet);

}  // namespace woodcock
