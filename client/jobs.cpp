// The commands about jobs that exist: jobs, show, watch, fetch, cancel, pause, resume, extend.
#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "client/adaptive_render.h"
#include "client/commands.h"
#include "client/event_list.h"
#include "client/fetch_frames.h"
#include "client/health.h"
#include "client/job_view.h"
#include "client/policy_options.h"
#include "client/print.h"
#include "client/progress_line.h"
#include "client/quote_record.h"
#include "client/service.h"
#include "client/watch_job.h"

namespace woodcock {
namespace {

struct JobOptions {
  ServiceOptions service;
  std::string job;
  bool json = false;
};

/// What all commands about one job take.
template <typename Options>
CLI::App* add_job_command(CLI::App& app, const std::string& name, const std::string& description, const std::shared_ptr<Options>& options) {
  auto* command = app.add_subcommand(name, description);
  command->add_option("job", options->job, "The job's id, as `woodcock submit` or `woodcock jobs` prints it")
      ->required()
      ->check(problem_of_job_id);
  add_service_options(*command, options->service);
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  return command;
}

double percent(const v1::Progress& progress) {
  if (progress.samples_total() <= 0) return 0;
  return 100 * static_cast<double>(progress.samples_done()) / static_cast<double>(progress.samples_total());
}

void print_job(const v1::Job& job) {
  const v1::Progress& progress = job.progress();
  say("job       {}  {}\n", job.job_id(), job.name());
  say("state     {}{}{}\n", state_name(job.state()), job.state_reason().empty() ? "" : ": ", job.state_reason());
  for (const std::string& line : policy_lines(job)) say("{}\n", line);
  if (job.has_target())
    say("target    {}\n", describe_target(job.target()));
  else
    say("samples   {} per pixel, {:.1f} % done\n", job.settings().samples(), percent(progress));
  say("tasks     {} of {} done, {} leased, {} given up\n", progress.tasks_done(), progress.tasks_total(), progress.tasks_leased(),
      progress.tasks_failed());
  say("cost      {} of processor time so far\n", format_seconds(progress.worker_seconds()));
  if (job.has_quote()) say("quote     {}\n", quote_line(job.quote()));
  if (job.has_quote() && !job.quote().uncertain().empty()) say("          uncertain: {}\n", job.quote().uncertain());
  if (job.has_quote_outcome()) say("became    {}\n", outcome_line(job));
  if (progress.has_eta_seconds()) say("left      about {}\n", format_seconds(progress.eta_seconds()));
  for (const v1::FrameStatus& frame : job.frames()) {
    say("frame {:<4}{}", frame.frame(), state_name(frame.state()));
    const bool ended = frame.state() == v1::FRAME_STATE_DONE || frame.state() == v1::FRAME_STATE_PARTIAL;
    if (frame.has_adaptive() && !ended) say(", {}", pass_line(frame));
    if (ended || (frame.has_adaptive() && frame.has_statistics())) say(", {}", error_line(frame.statistics()));
    if (ended && job.has_target() && frame.reason().empty()) say(", {}", target_line(job, frame));
    if (!frame.waiting_reason().empty()) say(", waits: {}", frame.waiting_reason());
    if (!frame.reason().empty()) say(", {}", frame.reason());
    say("\n");
    for (const std::string& line : health_warnings(health_of(frame))) say("  warning: {}\n", line);
    for (const v1::FailedTask& task : frame.failed_tasks())
      say("  given up: pixels {},{} to {},{}, samples {} to {}: {}\n", task.rect().x0(), task.rect().y0(), task.rect().x1(),
          task.rect().y1(), task.range().begin(), task.range().end(), task.last_error());
  }
}

std::string outcome(const v1::Job& job) { return fmt::format("job {} is {}", job.job_id(), state_name(job.state())); }

void report(const v1::Job& job, bool json) {
  if (json)
    say_json(job_json(job));
  else
    say("{}\n", outcome(job));
}

/// All jobs, newest first, without their frames.
std::vector<v1::Job> list_jobs(Service& service) {
  return service.list(&v1::JobsService::Stub::ListJobs, v1::ListJobsRequest(), &v1::ListJobsResponse::jobs, "listing the jobs");
}

void print_jobs(const std::vector<v1::Job>& jobs, bool json) {
  if (json) {
    nlohmann::json all = nlohmann::json::array();
    for (const v1::Job& job : jobs) all.push_back(job_json(job));
    say_json(nlohmann::json{{"jobs", all}});
    return;
  }
  if (jobs.empty()) {
    say("no jobs yet: woodcock submit SCENE\n");
    return;
  }
  say("{:<26} {:<11} {:>7} {:>7} {:>6}  {:<12} {}\n", "JOB", "STATE", "DONE", "FRAMES", "SPP", "USER", "NAME");
  for (const v1::Job& job : jobs)
    say("{:<26} {:<11} {:>6.1f}% {:>7} {:>6}  {:<12} {}\n", job.job_id(), state_name(job.state()), percent(job.progress()),
        job.frame_count(), job.settings().samples(), job.policy().user(), job.name());
}

/// One call that answers with the job.
template <typename Request, typename Response, typename Method>
int act(const JobOptions& options, Method method, Request request, const std::string& what) {
  Service service(options.service);
  request.set_job_id(options.job);
  Response response;
  service.call(method, request, response, what + " job " + options.job);
  say_outcome(outcome(response.job()), [&] { report(response.job(), options.json); });
  return 0;
}

}  // namespace

void add_jobs_command(CLI::App& app, int& code) {
  struct Options : JobOptions {
    bool quotes = false;
  };
  auto* command = app.add_subcommand("jobs", "List the coordinator's jobs, newest first");
  auto options = std::make_shared<Options>();
  add_service_options(*command, options->service);
  command->add_flag("--quotes", options->quotes, "Those that were submitted with --quote: what they were said to cost, what they cost");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer("Examples:\n  woodcock jobs\n  woodcock jobs --quotes         how good the quotes were");
  command->callback([options, &code] {
    Service service(options->service);
    if (options->quotes)
      print_quote_record(list_jobs(service), options->json);
    else
      print_jobs(list_jobs(service), options->json);
    code = 0;
  });
}

void add_show_command(CLI::App& app, int& code) {
  struct Options : JobOptions {
    bool events = false;
    int64_t after = 0;
  };
  auto options = std::make_shared<Options>();
  auto* command = add_job_command(app, "show", "Show a job with its frames, what it waits for, and what failed", options);
  auto* events = command->add_flag("--events", options->events, "What happened to it, from the first event on, a line each");
  command->add_option("--after", options->after, "Only the events after this number")->check(CLI::NonNegativeNumber)->needs(events);
  command->footer("Examples:\n  woodcock show JOB\n  woodcock show JOB --events");
  command->callback([options, &code] {
    Service service(options->service);
    code = 0;
    if (options->events) return print_events(service, options->job, options->after, options->json);
    const v1::Job job = service.job(options->job);
    if (options->json)
      say_json(job_json(job));
    else
      print_job(job);
  });
}

void add_watch_command(CLI::App& app, int& code) {
  auto options = std::make_shared<JobOptions>();
  auto* command = add_job_command(app, "watch", "Show a job's progress until it has ended", options);
  command->footer(
      "Example:\n  woodcock watch JOB\nExit codes: 0 done, 1 failed or cancelled, 3 ended with parts missing. Ctrl-C stops watching, not "
      "the job.");
  command->callback([options, &code] {
    Service service(options->service);
    const auto job = watch_job_on_terminal(service, options->job, options->json);
    if (job) report(*job, options->json);
    if (job) report_health(health_of(*job));
    code = job ? exit_code(job->state()) : 1;
  });
}

void add_fetch_command(CLI::App& app, int& code) {
  struct Options : JobOptions {
    FetchOptions fetch;
  };
  auto options = std::make_shared<Options>();
  auto* command = add_job_command(app, "fetch", "Write a job's images as EXR with a PNG beside", options);
  command->add_option("-o,--output", options->fetch.output,
                      "EXR to write; #### stands for the frame's number; without it the job's name, which must not exist yet");
  command->add_option("--frame", options->fetch.frame, "Only this frame");
  command->add_flag("--partial", options->fetch.partial,
                    "Take what is finished so far: the first samples of each pixel that there are (exit code 3)");
  command->footer("Examples:\n  woodcock fetch JOB -o cloud.exr\n  woodcock fetch JOB --partial -o preview.exr");
  command->callback([options, &code] {
    Service service(options->service);
    options->fetch.quiet = options->json;
    const Fetched fetched = fetch_frames(service, service.job(options->job), options->fetch);
    if (options->json) say_json(nlohmann::json{{"job_id", options->job}, {"images", fetched.frames}});
    code = fetched.complete ? 0 : 3;
  });
}

void add_cancel_command(CLI::App& app, int& code) {
  auto options = std::make_shared<JobOptions>();
  add_job_command(app, "cancel", "End a job; finished results are kept for later jobs", options)
      ->footer("Example:\n  woodcock cancel JOB")
      ->callback([options, &code] {
        code = act<v1::CancelJobRequest, v1::CancelJobResponse>(*options, &v1::JobsService::Stub::CancelJob, {}, "cancelling");
      });
}

void add_pause_command(CLI::App& app, int& code) {
  auto options = std::make_shared<JobOptions>();
  add_job_command(app, "pause", "Give a job no more workers; what runs may finish", options)
      ->footer("Example:\n  woodcock pause JOB")
      ->callback([options, &code] {
        code = act<v1::PauseJobRequest, v1::PauseJobResponse>(*options, &v1::JobsService::Stub::PauseJob, {}, "pausing");
      });
}

void add_resume_command(CLI::App& app, int& code) {
  auto options = std::make_shared<JobOptions>();
  add_job_command(app, "resume", "Go on with a paused job", options)->footer("Example:\n  woodcock resume JOB")->callback([options, &code] {
    code = act<v1::ResumeJobRequest, v1::ResumeJobResponse>(*options, &v1::JobsService::Stub::ResumeJob, {}, "resuming");
  });
}

void add_repin_command(CLI::App& app, int& code) {
  auto options = std::make_shared<JobOptions>();
  add_job_command(app, "repin", "Start the frames of a job again whose render build no connected worker has, e.g. after an upgrade",
                  options)
      ->footer("Example:\n  woodcock repin JOB")
      ->callback([options, &code] {
        Service service(options->service);
        v1::RepinJobRequest request;
        request.set_job_id(options->job);
        v1::RepinJobResponse response;
        service.call(&v1::JobsService::Stub::RepinJob, request, response, "starting job " + options->job + " again");
        const std::string again = fmt::format("frames that start again: {}", response.frames());
        say_outcome(again, [&] {
          if (!options->json) say("{}\n", again);
          report(response.job(), options->json);
        });
        code = 0;
      });
}

void add_extend_command(CLI::App& app, int& code) {
  struct Options : JobOptions {
    int64_t samples = 0;
    std::optional<double> error;
    double seconds = 0;
  };
  auto options = std::make_shared<Options>();
  auto* command =
      add_job_command(app, "extend", "Raise a job's samples per pixel or tighten its target; only the difference is rendered", options);
  command->add_option("--spp,--max-spp", options->samples, "The new total of samples per pixel; of a job with a target the new limit")
      ->check(CLI::PositiveNumber);
  command
      ->add_option_function<std::string>(
          "--target-error", [options](const std::string& text) { options->error = parse_error_target("--target-error", text); },
          "The relative error to reach, e.g. 0.01 or 1%")
      ->type_name("E");
  command
      ->add_option_function<std::string>(
          "--max-time", [options](const std::string& text) { options->seconds = parse_time_limit(text); },
          "Time to render from now on, e.g. 90s, 5min or 2h; without it as long as the target takes")
      ->type_name("T");
  command->footer(
      "Examples:\n  woodcock extend JOB --spp 1024\n  woodcock extend JOB --target-error 1%\n  woodcock extend JOB --max-time 5min");
  command->callback([options, &code] {
    if (options->samples == 0 && !options->error && options->seconds == 0) throw CLI::RequiredError("--spp, --target-error or --max-time");
    v1::ExtendJobRequest request;
    request.set_samples(options->samples);
    if (options->error) request.set_target_error(*options->error);
    request.set_max_seconds(options->seconds);
    code = act<v1::ExtendJobRequest, v1::ExtendJobResponse>(*options, &v1::JobsService::Stub::ExtendJob, request, "extending");
  });
}

}  // namespace woodcock
