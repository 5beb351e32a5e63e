// The commands that let jobs go: delete, retain.
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/commands.h"
#include "client/event_list.h"
#include "client/job_view.h"
#include "client/print.h"
#include "client/service.h"
#include "rpc/quantities.h"

namespace woodcock {
namespace {

/// A clean-up looks at every file that the coordinator has.
constexpr std::chrono::minutes kCleanUpDeadline{60};

std::string cause_name(v1::RetentionCause cause) { return cause == v1::RETENTION_CAUSE_AGE ? "age" : "size"; }

nlohmann::json retention_json(const v1::RetainJobsResponse& response, bool dry_run) {
  nlohmann::json jobs = nlohmann::json::array();
  for (const v1::RetiredJob& job : response.jobs())
    jobs.push_back({{"job_id", job.job_id()},
                    {"name", job.name()},
                    {"ended_unix_ms", job.ended_unix_ms()},
                    {"cause", cause_name(job.cause())},
                    {"freed_bytes", job.freed_bytes()}});
  return {{"dry_run", dry_run},
          {"jobs", jobs},
          {"jobs_total", response.jobs_total()},
          {"freed_bytes", response.freed_bytes()},
          {"bytes_before", response.bytes_before()},
          {"bytes_after", response.bytes_after()},
          {"keep_seconds", response.keep_seconds()},
          {"keep_bytes", response.keep_bytes()}};
}

void print_retention(const v1::RetainJobsResponse& response, bool dry_run) {
  if (response.keep_seconds() == 0 && response.keep_bytes() == 0) {
    say("jobs are kept until somebody deletes them: the coordinator has neither --keep-jobs nor --keep-bytes\n");
    return;
  }
  if (response.jobs_size() > 0) say("{:<26} {:<20} {:<5} {:>12}  {}\n", "JOB", "ENDED", "CAUSE", "FREES", "NAME");
  for (const v1::RetiredJob& job : response.jobs())
    say("{:<26} {:<20} {:<5} {:>12}  {}\n", job.job_id(), utc_time(job.ended_unix_ms()), cause_name(job.cause()),
        rpc::bytes_text(job.freed_bytes()), job.name());
  if (response.jobs_total() > response.jobs_size()) say("… and {} more\n", response.jobs_total() - response.jobs_size());
  say("{} job{} {}, {} of {}\n", response.jobs_total(), response.jobs_total() == 1 ? "" : "s", dry_run ? "would go" : "went",
      rpc::bytes_text(response.freed_bytes()), rpc::bytes_text(response.bytes_before()));
}

}  // namespace

void add_delete_command(CLI::App& app, int& code) {
  struct Options {
    ServiceOptions service;
    std::string job;
    bool cancel = false, json = false;
  };
  auto options = std::make_shared<Options>();
  auto* command =
      app.add_subcommand("delete", "Forget a job that has ended, with its images, results and scene files that no other job has");
  command->add_option("job", options->job, "The job's id, as `woodcock submit` or `woodcock jobs` prints it")
      ->required()
      ->check(problem_of_job_id);
  add_service_options(*command, options->service);
  command->add_flag("--cancel", options->cancel, "Cancel it first where it has not ended");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer("Examples:\n  woodcock delete JOB\n  woodcock delete JOB --cancel      of a job that still runs");
  command->callback([options, &code] {
    Service service(options->service);
    service.job(options->job);  // a name that is wrong is told from one that has gone
    v1::DeleteJobRequest request;
    request.set_job_id(options->job);
    request.set_cancel(options->cancel);
    v1::DeleteJobResponse response;
    try {
      service.call(&v1::JobsService::Stub::DeleteJob, request, response, "deleting job " + options->job);
    } catch (const rpc::RpcError& error) {
      // The answer to a call before was lost.
      if (error.code() != rpc::Code::kNotFound) throw;
    }
    say_outcome("job " + options->job + " is deleted", [&] {
      if (options->json)
        say_json(nlohmann::json{{"job_id", options->job}, {"deleted", true}});
      else
        say("job {} is deleted\n", options->job);
    });
    code = 0;
  });
}

void add_retain_command(CLI::App& app, int& code) {
  struct Options {
    ServiceOptions service;
    std::optional<std::string> keep_jobs, keep_bytes;
    bool dry_run = false, json = false;
  };
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("retain", "Let the jobs go that are older or larger than the coordinator keeps, and free the disk");
  add_service_options(*command, options->service);
  command->add_flag("--dry-run", options->dry_run, "List what would go, and let nothing go");
  command->add_option("--keep-jobs", options->keep_jobs, "With --dry-run: as if the coordinator had this limit, e.g. 90d, 12h; 0: none");
  command->add_option("--keep-bytes", options->keep_bytes, "With --dry-run: as if the coordinator had this limit, e.g. 500G; 0: none");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "The limits are options of woodcock-coordinator, --keep-jobs and --keep-bytes. It applies them every ten minutes, and at once by "
      "this\n"
      "command without --dry-run.\n"
      "Examples:\n  woodcock retain --dry-run\n  woodcock retain --dry-run --keep-bytes 500G");
  command->callback([options, &code] {
    v1::RetainJobsRequest request;
    request.set_dry_run(options->dry_run);
    try {
      if (options->keep_jobs) request.set_keep_seconds(rpc::parse_seconds("--keep-jobs", *options->keep_jobs));
      if (options->keep_bytes) request.set_keep_bytes(rpc::parse_bytes("--keep-bytes", *options->keep_bytes));
    } catch (const std::invalid_argument& error) {
      throw CLI::ValidationError(error.what());
    }
    if (!options->dry_run && (request.has_keep_seconds() || request.has_keep_bytes()))
      throw CLI::ValidationError("--keep-jobs and --keep-bytes need --dry-run; the limits that hold are options of woodcock-coordinator");
    Service service(options->service);
    v1::RetainJobsResponse response;
    service.call(&v1::JobsService::Stub::RetainJobs, request, response, "asking what is retained", kCleanUpDeadline);
    if (options->json)
      say_json(retention_json(response, options->dry_run));
    else
      print_retention(response, options->dry_run);
    code = 0;
  });
}

}  // namespace woodcock
