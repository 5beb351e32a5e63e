// Jobs as text and as JSON.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

#include "renderer/accuracy/convergence.h"
#include "woodcock/v1/job.pb.h"
#include "woodcock/v1/jobs_service.pb.h"

namespace woodcock {

/// "running", "done", …
std::string state_name(v1::JobState state);
std::string state_name(v1::FrameState state);
/// "no_worker", …; empty for a frame that does not wait.
std::string waiting_name(v1::WaitingReason reason);
bool has_ended(v1::JobState state);

/// 0 done or still going, 1 failed or cancelled, 3 partial.
int exit_code(v1::JobState state);

nlohmann::json job_json(const v1::Job& job);
nlohmann::json frame_json(const v1::FrameStatus& frame);
nlohmann::json statistics_json(const v1::FrameStatistics& statistics);

/// The error of a frame's first samples; empty where the coordinator knows none. Throws std::runtime_error for nonsense.
Convergence convergence_of(const v1::GetFrameResponse& response);

/// "pass 3, 12 of 40 blocks".
std::string pass_line(const v1::FrameStatus& frame);
/// "relative error 2 %, 30 s of rendering at most, 4096 samples per pixel at most".
std::string describe_target(const v1::SamplingTarget& target);
/// Whether a frame with this relative error has reached the target, whose error is not 0.
bool reaches(double relative_error, const v1::SamplingTarget& target);
/// Whether a frame that has ended reached its job's target, or what ended it.
std::string target_line(const v1::Job& job, const v1::FrameStatus& frame);

/// "error 1.2 % of the mean (95 % interval 1.1 % to 1.3 %)", and what else a user should know of a frame's image.
std::string error_line(const v1::FrameStatistics& statistics);

}  // namespace woodcock
