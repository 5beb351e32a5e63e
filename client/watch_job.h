// Following a job to its end.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "client/service.h"

namespace woodcock {

/// Called with what is new: events in order, none left out or repeated, and the job without its frames.
using JobUpdate = std::function<void(const v1::WatchJobResponse& update)>;

/// Follows the job until it has ended; nullopt when interrupted (Ctrl-C). Waits as long as the job lives, through silence,
/// restarts of the coordinator and cuts of the network; `say` is told when it goes and when it is back. Throws rpc::RpcError when
/// asking again cannot help: the coordinator does not know the job.
std::optional<v1::Job> watch_job(Service& service, const std::string& job_id, const JobUpdate& update,
                                 const std::function<void(const std::string& line)>& say = {});

/// The same with a progress bar or lines on standard error, and a line for each event that a user should know of.
/// `quiet` shows nothing.
std::optional<v1::Job> watch_job_on_terminal(Service& service, const std::string& job_id, bool quiet);

}  // namespace woodcock
