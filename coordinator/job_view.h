// What the coordinator knows, as messages.
#pragma once

#include "coordinator/scheduler.h"
#include "woodcock/v1/job.pb.h"
#include "woodcock/v1/jobs_service.pb.h"

namespace woodcock::coordinator {

v1::FrameStatistics to_wire(const FrameStatistics& statistics);
void add_convergence(const Convergence& record, v1::GetFrameResponse& response);
/// Without what it waits for.
v1::FrameStatus frame_view(const Job& job, const Frame& frame);
void set_waiting(v1::FrameStatus& status, const Waiting& waiting);
/// Without frames, and without what is under way.
v1::Job job_view(const JobSpec& spec, const JobRow& row, const JobSummary& summary);
/// Of a job that has ended, with its frames.
v1::Job job_view(const Job& job);
/// Of a job in memory. Frames are left out unless asked for.
v1::Job job_view(const Scheduler& scheduler, const Job& job, bool with_frames, Time now);
v1::TaskResult result_view(const TaskRef& ref, const SettledTask& task);
v1::JobEvent to_wire(const JobEvent& event);
v1::TaskAttempt to_wire(const AttemptRecord& attempt);
v1::WorkerStatus to_wire(const WorkerView& worker);

}  // namespace woodcock::coordinator
