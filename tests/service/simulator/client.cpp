#include "tests/service/simulator/client.h"

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/manifest.h"
#include "tests/service/simulator/checks.h"
#include "tests/service/simulator/leader.h"
#include "tests/service/simulator/rendering.h"

namespace woodcock::simulator {

using coordinator::Coordinator;

Client::Client(World& world, const std::string& manifest_digest) : world_(world), jobs_(static_cast<size_t>(world.plan.jobs)) {
  for (size_t i = 0; i < jobs_.size(); ++i) {
    Job& job = jobs_[i];
    job.request = request(static_cast<int>(i), manifest_digest);
    job.id = std::string(1, 'j').append(rpc::blob_digest(job.request.request_id()), 0, 12);
    job.samples = job.request.settings().samples();
    job.wishes = world_.random.chance(0.5) ? static_cast<int>(world_.random.between(1, 3)) : 0;
    world_.loop.after(world_.time(0, 5 * kSecond), [this, &job] { submit(job); });
  }
}

v1::SubmitJobRequest Client::request(int number, const std::string& manifest_digest) {
  Random& random = world_.random;
  const bool adaptive = world_.plan.adaptive && number == 0;
  const auto edge = static_cast<int>(random.between(1, 3)) * 16;
  const int64_t samples = adaptive ? 64 : 8 * random.between(1, 4);
  v1::SubmitJobRequest r;
  r.set_request_id(fmt::format("r{}-{:016x}", number, random.next()));
  r.set_name("job " + std::to_string(number));
  r.set_priority(static_cast<int32_t>(random.below(2)));
  r.mutable_settings()->set_samples(samples);
  r.mutable_settings()->set_tile_size(16);
  // Names the job whose poison there may be.
  r.mutable_settings()->set_seed(number == 0 ? 1 : 2);
  if (adaptive) {
    r.mutable_target()->set_error(0.01);
    r.mutable_target()->set_max_samples(samples);
  }
  const auto frames = random.between(1, 2);
  for (int64_t f = 0; f < frames; ++f) {
    v1::FrameInput* frame = r.add_frames();
    frame->set_manifest_digest(manifest_digest);
    frame->set_scene_file("scene.pbrt");
    FrameHeader header;
    header.scene_digest = std::string(64, 'a');
    header.settings_digest = std::string(64, world_.plan.same_scene ? 'b' : static_cast<char>('b' + number));
    header.frame = static_cast<uint64_t>(f);
    header.width = header.height = 48;
    header.bounds = {0, 0, edge, 16 * static_cast<int>(random.between(1, 2))};
    header.settings = {{"estimator", "auto"}};
    *frame->mutable_header() = rpc::to_wire(header);
  }
  return r;
}

namespace {

v1::WatchJobResponse answer(const v1::Job& job) {
  v1::WatchJobResponse response;
  *response.mutable_job() = job;
  return response;
}

}  // namespace

void Client::ask(Job& job, const std::string& what, Work work, Answered answered) {
  const auto over = std::make_shared<bool>(false);
  world_.send("client", Way::kToCoordinator, [this, &job, what, work, answered, over] {
    v1::WatchJobResponse response;
    bool done = false, repeat = false;
    const bool heard = world_.leader->call({what.c_str()}, [&](Coordinator& c) {
      try {
        response = work(c);
        done = true;
      } catch (const rpc::RpcError& error) {
        repeat = rpc::is_retryable(error.code());
        world_.journal.say("client", "{} {}: {}", what, job.id, error.what());
      }
    });
    // What was said before the end of the process is true, what it said afterwards nobody has heard.
    if (!heard || repeat) return;
    if (done && response.has_job()) {
      world_.checks->shown(response.job(), job.extend_asked);
      job.cancelled = job.cancelled || response.job().state() == v1::JOB_STATE_CANCELLED;
    }
    world_.send("client", Way::kFromCoordinator, [answered, over, done, response] {
      if (!std::exchange(*over, true)) answered(done, response);
    });
  });
  world_.loop.after(3 * kSecond, [this, &job, what, work, answered, over] {
    if (!std::exchange(*over, true)) ask(job, what, work, answered);
  });
}

void Client::submit(Job& job) {
  ask(
      job, "submit",
      [this, &job](Coordinator& c) {
        const std::string id = c.submit(job.request).job_id();
        if (id != job.id) world_.violate("request " + job.request.request_id() + " was given the job id " + id);
        return v1::WatchJobResponse();
      },
      [this, &job](bool done, const v1::WatchJobResponse&) {
        if (!done) return world_.violate("the submit of " + job.id + " was refused");
        world_.journal.say("client", "knows that {} is accepted", job.id);
        job.accepted = true;
        watch(job);
        if (job.wishes > 0) world_.loop.after(world_.time(0, 10 * kSecond), [this, &job] { wish(job); });
      });
}

/// Asks for something, and when it is granted for the next thing.
void Client::wish(Job& job) {
  const Answered granted = [this, &job](bool, const v1::WatchJobResponse&) {
    job.granted = world_.loop.now();
    if (--job.wishes > 0) world_.loop.after(world_.time(0, 10 * kSecond), [this, &job] { wish(job); });
  };
  const int64_t which = job.paused ? 1 : world_.random.below(10);
  if (which == 0) {
    job.cancel_asked = true;
    ask(
        job, "cancel", [&job](Coordinator& c) { return answer(c.cancel(job.id)); }, granted);
  } else if (which <= 4) {
    const bool pause = !job.paused;
    job.paused = pause;
    if (pause) ++job.wishes;  // to go on
    ask(
        job, pause ? "pause" : "resume", [&job, pause](Coordinator& c) { return answer(c.set_paused(job.id, pause)); }, granted);
  } else if (which <= 7) {
    job.extend_asked = true;
    const int64_t samples = 2 * job.samples;
    const std::optional<double> error = job.request.has_target() ? std::optional(0.01) : std::nullopt;
    ask(
        job, "extend", [&job, error, samples](Coordinator& c) { return answer(c.extend(job.id, samples, error)); },
        [&job, samples, granted](bool done, const v1::WatchJobResponse& response) {
          if (done) job.samples = samples;
          granted(done, response);
        });
  } else {
    ask(
        job, "look at", [&job](Coordinator& c) { return answer(c.job(job.id)); }, granted);
  }
}

void Client::watch(Job& job) {
  ask(
      job, "watch",
      [&job, cursor = job.cursor](Coordinator& c) {
        bool finished = false;
        return c.watch(job.id, cursor, finished);
      },
      [this, &job, asked = world_.loop.now()](bool done, const v1::WatchJobResponse& response) {
        if (!done) return world_.violate("job " + job.id + " was accepted and cannot be watched");
        take_events(job, response);
        job.seen = response.job();
        job.asked = asked;
        // A pause that was long under way came after all.
        if (job.seen->state() == v1::JOB_STATE_PAUSED && job.wishes == 0) {
          ++job.wishes;
          job.paused = true;
          wish(job);
        }
        world_.loop.after(world_.time(kSecond, 4 * kSecond), [this, &job] { watch(job); });
      });
}

/// Numbered one after the other, and never taken back.
void Client::take_events(Job& job, const v1::WatchJobResponse& response) {
  for (const v1::JobEvent& event : response.events()) {
    const std::string text = fmt::format("{} {} {} {}", event.kind(), event.task_id(), event.worker_id(), event.message());
    const auto [known, first] = job.events.emplace(event.number(), text);
    if (first) world_.journal.say("client", "sees event {} of {}: {}", event.number(), job.id, text);
    if (!first && known->second != text)
      world_.violate(fmt::format("event {} of job {} was \"{}\" and is \"{}\"", event.number(), job.id, known->second, text));
    if (first && event.number() != job.cursor + 1)
      world_.violate(fmt::format("job {} has event {} after event {}", job.id, event.number(), job.cursor));
    job.cursor = std::max(job.cursor, event.number());
  }
}

bool Client::satisfied() const {
  return std::all_of(jobs_.begin(), jobs_.end(), [](const Job& job) {
    return job.accepted && job.wishes == 0 && job.seen && job.asked > job.granted && job.seen->state() >= v1::JOB_STATE_DONE &&
           job.seen->last_event() == job.cursor;
  });
}

std::string Client::describe() const {
  std::string text;
  for (const Job& job : jobs_)
    text +=
        fmt::format("{} {}accepted, {} wishes open, {} {}; ", job.id, job.accepted ? "" : "not ", job.wishes,
                    job.seen ? v1::JobState_Name(job.seen->state()) : "not seen",
                    job.seen ? fmt::format("{} of {} tasks", job.seen->progress().tasks_done(), job.seen->progress().tasks_total()) : "");
  return text;
}

void Client::check_end(Coordinator& coordinator) {
  for (const Job& job : jobs_) {
    const v1::Job end = coordinator.job(job.id);
    world_.checks->shown(end, job.extend_asked);
    const std::string state = v1::JobState_Name(end.state());
    // A task is given up after its parts, down to the smallest, failed too.
    const bool may_lack = world_.plan.poison || world_.failed_attempts >= 4;
    if (end.state() == v1::JOB_STATE_CANCELLED ? !job.cancel_asked : job.cancelled)
      world_.violate(
          fmt::format("job {} is {} although its cancel was {}", job.id, state, job.cancel_asked ? "confirmed" : "never asked for"));
    if ((end.state() == v1::JOB_STATE_PARTIAL || end.state() == v1::JOB_STATE_FAILED) && !may_lack)
      world_.violate(fmt::format("job {} is {} ({}), which its faults do not explain", job.id, state, end.state_reason()));
    if (end.state() < v1::JOB_STATE_DONE) world_.violate("job " + job.id + " has not ended: " + state);
    if (end.state() != v1::JOB_STATE_DONE) continue;
    if (end.progress().tasks_done() != end.progress().tasks_total() || end.progress().samples_done() != end.progress().samples_total())
      world_.violate(
          fmt::format("job {} is done with {} of {} samples", job.id, end.progress().samples_done(), end.progress().samples_total()));
    for (const v1::FrameStatus& status : end.frames()) {
      const v1::GetFrameResponse response = coordinator.frame(job.id, status.frame(), false);
      const FrameHeader header = rpc::from_wire(status.header());
      SampleMap map{header.bounds, {}};
      for (size_t b = 0; b < map.grid().size(); ++b)
        map.counts.push_back(job.request.has_target() ? last_count(header, b, end.target().max_samples()) : end.settings().samples());
      if (!job.request.has_target() && end.settings().samples() != job.samples && !job.extend_asked)
        world_.violate("job " + job.id + " has other samples than it was asked for");
      if (coordinator.blobs().read(response.image_digest(), 1 << 20) != image_of(header, map))
        world_.violate(fmt::format("the image of frame {} of job {} is not that of an undisturbed render", status.frame(), job.id));
    }
  }
}

}  // namespace woodcock::simulator
