// `woodcock submit`: a scene to the coordinator.
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>
#include <vector>

#include "client/adaptive_render.h"
#include "client/commands.h"
#include "client/fetch_frames.h"
#include "client/frame_list.h"
#include "client/frame_options.h"
#include "client/health.h"
#include "client/interrupt.h"
#include "client/job_view.h"
#include "client/policy_options.h"
#include "client/print.h"
#include "client/progress_line.h"
#include "client/quote.h"
#include "client/quote_record.h"
#include "client/service.h"
#include "client/submission.h"
#include "client/watch_job.h"

namespace woodcock {
namespace {

struct SubmitOptions {
  ServiceOptions service;
  FrameSettings settings;
  TargetOptions target;
  std::string scene, output, name;
  std::optional<std::string> frames;
  int priority = 0, tile = 0;
  v1::JobPolicy policy;
  bool watch = false, json = false;
  bool dry_run = false, here = false, quote = false;
  QuoteRun quote_run;
};

/// Those of --frames; frame 0 without. Throws CLI::ValidationError.
std::vector<uint64_t> frames_of(const SubmitOptions& options) {
  if (!options.frames) return {0};
  try {
    FrameList list = parse_frame_list(*options.frames);
    check_scene_of_sequence(options.scene, list.frames.size());
    if (!list.repeated.empty())
      note("note: --frames names these more than once, and they are rendered once: {}\n", describe_frames(list.repeated));
    return std::move(list.frames);
  } catch (const std::invalid_argument& error) {
    throw CLI::ValidationError("--frames", error.what());
  }
}

/// The quote of the job's first frame.
QuoteRun quote_run(const SubmitOptions& options, uint64_t first) {
  QuoteRun run = options.quote_run;
  run.scene = !options.frames ? options.scene : with_frame_number(options.scene, first);
  run.settings = options.settings;
  run.settings.frame = first;
  run.error = options.target.error;
  run.json = options.json;
  return run;
}

/// The frames and what is asked of them; nothing is sent yet.
Submission prepare(const SubmitOptions& options, const std::vector<uint64_t>& frames) {
  Submission submission;
  submission.request.set_request_id(random_request_id());
  submission.request.set_name(options.name.empty() ? options.scene.substr(options.scene.find_last_of('/') + 1) : options.name);
  submission.request.set_priority(options.priority);
  *submission.request.mutable_policy() = options.policy;
  for (const uint64_t number : frames) {
    FrameSettings settings = options.settings;
    settings.frame = number;
    add_frame(!options.frames ? options.scene : with_frame_number(options.scene, number), settings, options.tile, submission);
  }
  if (options.target.adaptive()) {
    const SamplingTarget target = sampling_target(options.target);
    submission.request.mutable_target()->set_error(target.error);
    submission.request.mutable_target()->set_max_samples(target.max_samples);
    submission.request.mutable_target()->set_max_seconds(options.target.max_seconds.value_or(0));
  }
  // Before anything is uploaded.
  rpc::check_text_fields(submission.request);
  return submission;
}

/// Puts the job's quote into its request. The job is wanted, with a quote or without.
void add_quote(const QuoteRun& run, Service& service, Submission& submission) {
  try {
    const v1::Quote quote = to_wire(make_quote(run, service, submission));
    if (!run.json) note("quote     {}\n", quote_line(quote));
    if (quote.relative_error() > rpc::kMaxQuotedError || quote.samples_high() > rpc::kMaxSamplesPerPixel ||
        quote.cpu_seconds_high() > rpc::kMaxQuotedSeconds || quote.seconds_high() > rpc::kMaxQuotedSeconds)
      throw NoQuote("no quote is kept: it is beyond any job's bounds");
    *submission.request.mutable_quote() = quote;
  } catch (const NoQuote& reason) {
    if (interrupt_flag()) throw;
    note("warning: {}; the job is submitted without one\n", reason.what());
  }
}

/// What is left when the coordinator has the job: says so, follows it and fetches its images as far as the options ask. Returns the exit
/// code.
int follow_up(const SubmitOptions& options, Service& service, const v1::SubmitJobRequest& job, const std::string& id, int64_t uploaded) {
  nlohmann::json report{{"job_id", id}, {"uploaded_bytes", uploaded}, {"frames", job.frames_size()}};
  if (job.has_quote()) report["quote"] = quote_json(job.quote());
  const bool follow = options.watch || !options.output.empty();
  if (!options.json && !follow) {
    say("{}\n", id);
    note("job {}: {} frame{}, {}; follow it with: woodcock watch {}\n", id, job.frames_size(), job.frames_size() == 1 ? "" : "s",
         job.has_target() ? describe_target(job.target()) : fmt::format("{} samples per pixel", job.settings().samples()), id);
  }
  int code = 0;
  if (follow) {
    const auto seen = watch_job_on_terminal(service, id, options.json);
    if (!seen) return 1;
    service.wait_for_ever();
    code = exit_code(seen->state());
    report["job"] = job_json(*seen);
    if (!options.json && seen->has_quote_outcome()) note("became    {}\n", outcome_line(*seen));
    if (code == 1) {
      if (!options.json) note("job {} is {}: {}\n", id, state_name(seen->state()), seen->state_reason());
    } else if (!options.output.empty()) {
      FetchOptions fetch;
      fetch.output = options.output;
      fetch.quiet = options.json;
      report["images"] = fetch_frames(service, *seen, fetch).frames;
    } else {
      if (!options.json) {
        say("{}\n", id);
        note("job {} is {}; get it with: woodcock fetch {} -o OUT.exr\n", id, state_name(seen->state()), id);
      }
      report_health(health_of(*seen));
    }
  }
  if (options.json) say_json(report);
  rpc::flush_standard_output();
  return code;
}

int run(const SubmitOptions& options) {
  const std::vector<uint64_t> frames = frames_of(options);
  const QuoteRun quoted = quote_run(options, frames.front());
  if (options.dry_run && options.here) {
    print_quote(quoted, make_quote(quoted));
    return 0;
  }
  if (!options.dry_run) check_output(options.output, static_cast<int64_t>(frames.size()));
  Submission submission = prepare(options, frames);
  Service service(options.service);
  if (options.dry_run) {
    print_quote(quoted, make_quote(quoted, service, submission));
    return 0;
  }
  if (options.quote) add_quote(quoted, service, submission);
  const int64_t uploaded = upload_missing(service, submission, options.json);
  v1::SubmitJobResponse response;
  service.call(&v1::JobsService::Stub::SubmitJob, submission.request, response, "submitting the job");
  try {
    return follow_up(options, service, submission.request, response.job_id(), uploaded);
  } catch (const std::exception& error) {
    // Whatever failed, the job is there, and this may be the only place where its id is seen.
    throw std::runtime_error(fmt::format("{}; the job was submitted: {}", error.what(), response.job_id()));
  }
}

}  // namespace

void add_submit_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("submit", "Give a scene to the coordinator to be rendered by its workers");
  auto options = std::make_shared<SubmitOptions>();
  command->add_option("scene", options->scene, "Scene file in pbrt-v4 format; with --frames, #### stands for the frame's number")
      ->required();
  add_service_options(*command, options->service);
  command->add_option("-o,--output", options->output,
                      "Wait for the end and write the EXR here, a PNG beside it; #### stands for the frame's number");
  command
      ->add_option("--frames", options->frames,
                   "Frames of a sequence: 7, or A-B with both ends, or A-BxS, every S-th of them; several with commas, as in 1-100x5,200")
      ->type_name("LIST");
  add_policy_options(*command, options->priority, options->policy);
  command->add_option("--name", options->name, "The job's name for people (default: the scene file's)")->check([](const std::string& name) {
    return name.empty() ? std::string("found an empty text, expected a name; without --name it is the scene file's") : std::string();
  });
  add_frame_options(*command, options->settings);
  add_target_options(*command, options->target);
  command
      ->add_option("--tile", options->tile,
                   "Edge of the leased tiles in pixels, a power of two from 8 to 1024; 0 leaves it to the coordinator")
      ->check(CLI::IsMember({0, 8, 16, 32, 64, 128, 256, 512, 1024}))
      ->capture_default_str();
  command->add_flag("--dry-run", options->dry_run,
                    "No job: quote its samples and time on the coordinator's present workers, from a pilot here and a small one there");
  command->add_flag("--here", options->here, "With --dry-run: quote for this machine; nothing is sent")->needs("--dry-run");
  command
      ->add_flag("--quote", options->quote, "Quote the job first, as --dry-run does, and keep the quote with it: `woodcock show` compares")
      ->excludes("--dry-run");
  add_quote_options(*command, options->quote_run);
  command->add_flag("--watch", options->watch, "Show progress until the job has ended");
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Examples:\n"
      "  woodcock submit scenes/cloud.pbrt --spp 256 -o cloud.exr       wait for the image\n"
      "  woodcock submit scenes/cloud.pbrt --spp 256                    prints the job's id and returns\n"
      "  woodcock submit scenes/cloud.pbrt --target-error 2% --max-time 5min -o cloud.exr\n"
      "  woodcock submit scenes/cloud.pbrt --spp 256 --dry-run          what that would cost the workers\n"
      "  woodcock submit scenes/cloud.pbrt --spp 256 --quote            the same, kept with the job\n"
      "  woodcock submit shot.####.pbrt --frames 1-24 -o shot.####.exr  a sequence\n"
      "  woodcock submit shot.####.pbrt --frames 1-100x5,200            every fifth frame, and one more\n"
      "  woodcock submit big.pbrt --require-tag big --memory 32G --max-workers 4 --after JOB\n"
      "The image is the one that `woodcock render` makes, to the bit.\n"
      "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 the job ended with parts missing.");
  command->callback([options, &code] {
    settle_targets(options->target, options->settings);
    if ((options->dry_run || options->quote) && options->target.max_seconds && !options->target.error && !options->target.max_samples)
      throw CLI::ValidationError(options->quote ? "--quote" : "--dry-run",
                                 "a limit of time alone costs that time: give --target-error or --spp");
    // The coordinator's limit is the job's number of samples.
    if (options->target.adaptive()) options->settings.samples = sampling_target(options->target).max_samples;
    code = run(*options);
  });
}

}  // namespace woodcock
