#include "tests/service/simulator/leader.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "rpc/failure.h"
#include "tests/service/simulator/checks.h"
#include "tests/service/simulator/inside.h"
#include "tests/service/simulator/rendering.h"

namespace woodcock::simulator {

using coordinator::BlobStore;
using coordinator::Coordinator;
using coordinator::CoordinatorInside;
using coordinator::CoordinatorOptions;

struct Leader::Process {
  uint64_t life = 0;
  std::filesystem::path folder;
  bool dead = false;      // ended; what it still says nobody hears
  bool outdated = false;  // another leads
  bool write_scheduled = false;
  uint64_t next_upload = 0;
  std::map<std::pair<std::string, uint64_t>, uint64_t> calls;  // held ones: worker and number → token
  std::unique_ptr<Coordinator> coordinator;
  std::map<uint64_t, std::unique_ptr<BlobStore::Upload>> uploads;  // gone before the coordinator
};

Leader::Leader(World& world, DiskImage disk) : world_(world), left_(std::move(disk)) {
  world_.disk.before_sync = [this](const std::string& path) {
    if (running_ && path.starts_with(running_->folder.string())) pass("sync");
  };
}

Leader::~Leader() {
  world_.disk.before_sync = {};
  for (const auto& process : {present_, outdated_})
    if (process) {
      process->dead = true;
      process->uploads.clear();
      process->coordinator.reset();
    }
}

CoordinatorOptions Leader::options_of(const std::shared_ptr<Process>& process) {
  Process* const self = process.get();
  CoordinatorOptions options;
  options.dir = self->folder;
  options.address = "coordinator:1";
  options.scheduler.lease = 6 * kSecond;
  options.scheduler.grace = 2 * kSecond;
  options.scheduler.worker_timeout = 12 * kSecond;
  options.scheduler.first_probe = 2 * kSecond;
  options.scheduler.copy_after = 3 * kSecond;
  options.min_free_bytes = 1;
  options.sync_hold = 4 * kSecond;
  options.busy_sync_hold = kSecond;
  options.own_threads = false;
  options.store_batch = world_.plan.store_batch;
  options.frames_a_step = 1;
  options.now = [this] { return world_.loop.now(); };
  options.unix_ms = [this] { return int64_t{1'700'000'000'000} + world_.loop.now() / kMillisecond; };
  options.make_id = [this] {
    std::string id;
    for (int i = 0; i < 2; ++i) id += fmt::format("{:016x}", world_.random.next());
    return id;
  };
  options.failpoint = [this, self](const char* point) {
    if (running_.get() == self) pass(point);
  };
  options.on_fatal = [this, self](const std::string& reason) {
    if (self->dead) return;
    world_.journal.say("coordinator", "ends: {}", reason);
    self->dead = true;
    if (!self->outdated || reason.find("another coordinator took the leadership") == std::string::npos)
      world_.violate("the coordinator ended itself: " + reason);
  };
  options.assemble_tiles = [this, self](const coordinator::AssembleRequest& request) {
    if (running_.get() == self) pass("during-merge");
    std::string problem;
    const coordinator::AssembleResult result = merge_tiles(request, problem);
    if (!problem.empty() && !self->dead) world_.violate(problem);
    return result;
  };
  return options;
}

void Leader::start() {
  const auto process = std::make_shared<Process>();
  process->life = ++lives_;
  process->folder = world_.folder / fmt::format("coordinator-{}", process->life);
  world_.journal.say("coordinator", "starts on {} files", left_.files.size());
  world_.disk.lay_out(std::exchange(left_, {}), process->folder);
  present_ = process;
  std::optional<std::string> error;
  running_ = process;
  error = rpc::failure_of([&] { process->coordinator = std::make_unique<Coordinator>(options_of(process)); });
  running_ = nullptr;
  if (error && !process->dead) world_.violate("the coordinator does not start: " + *error);
  if (process->dead || !process->coordinator) return bury();
  ++world_.restarts;
  world_.checks->started(*process->coordinator);
  keep_stepping(process);
  write_later(process);
}

bool Leader::call(const Step& step, const std::function<void(Coordinator&)>& work) { return present_ && run(present_, step, work); }

bool Leader::run(std::shared_ptr<Process> process, const Step& step, const std::function<void(Coordinator&)>& work) {
  if (process->dead || world_.violation) return false;
  running_ = process;
  // What a service would answer with a status. One that has lost its leadership may say anything.
  const auto error = rpc::failure_of([&] { work(*process->coordinator); });
  running_ = nullptr;
  if (error && !process->dead) world_.violate(fmt::format("{} threw: {}", step.name, *error));
  if (process->dead) {
    if (process == outdated_) {
      outdated_->uploads.clear();
      outdated_->coordinator.reset();
      outdated_ = nullptr;
    } else {
      bury();
    }
    return false;
  }
  if (process == present_) world_.checks->after(*process->coordinator, step);
  write_later(process);
  return true;
}

void Leader::keep_stepping(const std::shared_ptr<Process>& process) {
  const auto repeat = [this, process](Time low, Time high, const char* name, auto work) {
    // Each step makes the next; the last one finds the process dead.
    auto next = std::make_shared<std::function<void()>>();
    *next = [this, process, low, high, name, work, self = std::weak_ptr(next)] {
      const auto again = self.lock();
      if (process->dead || !again) return;
      run(process, {name}, work);
      if (!process->dead) world_.loop.after(world_.time(low, high), [again] { (*again)(); });
    };
    world_.loop.after(world_.time(low, high), [next] { (*next)(); });
  };
  repeat(900 * kMillisecond, 1100 * kMillisecond, "tick", [](Coordinator& c) { c.tick(); });
  repeat(200 * kMillisecond, 300 * kMillisecond, "answer overdue", [](Coordinator& c) { c.answer_overdue(); });
  repeat(50 * kMillisecond, 400 * kMillisecond, "merge", [](Coordinator& c) { c.step_merge(); });
}

void Leader::write_later(const std::shared_ptr<Process>& process) {
  if (process->dead || process->write_scheduled || CoordinatorInside::store(*process->coordinator).backlog() == 0) return;
  process->write_scheduled = true;
  world_.loop.after(world_.time(0, world_.calm ? 5 * kMillisecond : world_.plan.store_delay), [this, process] {
    process->write_scheduled = false;
    run(process, {"write"}, [](Coordinator& c) { c.step_store(); });
  });
}

// --- calls -------------------------------------------------------------------------------------------------------

void Leader::sync(uint64_t number, const v1::SyncRequest& request, const Reply& reply) {
  const auto process = outdated_ && world_.random.chance(0.5) ? outdated_ : present_;
  if (!process) {
    // Nobody listens, or nobody is there to say so.
    if (world_.calm || world_.random.chance(0.7)) reply({rpc::Code::kUnavailable, "connection refused"}, {});
    return;
  }
  const auto key = std::pair(request.worker_id(), number);
  auto answered = std::make_shared<bool>(false);
  const auto done = [this, key, request, reply, answered, weak = std::weak_ptr(process)](const rpc::Outcome& outcome,
                                                                                         const v1::SyncResponse& response) {
    const auto self = weak.lock();
    *answered = true;
    if (!self || self->dead) return;
    self->calls.erase(key);
    if (outcome.ok()) world_.checks->told(request, response, self->outdated);
    reply(outcome, response);
  };
  run(process, {"sync", &request}, [&](Coordinator& c) {
    const uint64_t token = c.sync(request, done);
    if (!*answered && token != 0) process->calls[key] = token;
  });
}

void Leader::cancel_sync(const std::string& worker, uint64_t number) {
  for (const auto& process : {present_, outdated_}) {
    if (!process) continue;
    const auto held = process->calls.find({worker, number});
    if (held == process->calls.end()) continue;
    const uint64_t token = held->second;
    process->calls.erase(held);
    run(process, {"cancel sync"}, [token](Coordinator& c) { c.cancel_sync(token); });
    return;
  }
}

void Leader::upload(const std::string& digest, const std::string& bytes, const std::function<void(bool)>& reply) {
  const auto process = present_;
  if (!process) return reply(false);
  std::string sent = bytes;
  if (world_.goes_wrong(Mishap::kUploadDamaged, world_.plan.damage_upload)) {
    sent[static_cast<size_t>(world_.random.below(static_cast<int64_t>(sent.size())))] ^= 1;
    world_.journal.say("network", "flips a bit of upload {:.8}", digest);
  }
  // Some arrive in two pieces, between which anything happens, and some end in the middle.
  const bool cut = world_.goes_wrong(Mishap::kUploadCut, world_.plan.cut_upload);
  const auto total = static_cast<int64_t>(sent.size());
  bool stored = false, goes_on = false;
  const uint64_t number = ++process->next_upload;
  const bool alive = run(process, {"upload"}, [&](Coordinator& c) {
    try {
      const auto [offset, complete] = c.blobs().upload_offset(digest);
      if (complete) {
        stored = true;
        return;
      }
      auto upload = c.blobs().begin_upload(digest, total, offset, world_.loop.now());
      const int64_t half = cut || world_.random.chance(0.3) ? world_.random.between(0, total - offset) : total - offset;
      upload->append(std::string_view(sent).substr(static_cast<size_t>(offset), static_cast<size_t>(half)), world_.loop.now());
      if (cut) return;
      if (upload->finish(world_.loop.now())) {
        stored = true;
        return;
      }
      sent = sent.substr(static_cast<size_t>(offset + half));
      process->uploads.emplace(number, std::move(upload));
      goes_on = true;
    } catch (const coordinator::BlobError& error) {
      world_.journal.say("coordinator", "refuses upload {:.8}: {}", digest, error.what());
    }
  });
  if (!alive) return;
  if (!goes_on) return reply(stored);
  world_.loop.after(world_.time(kMillisecond, 500 * kMillisecond), [this, process, number, digest, rest = std::move(sent), reply] {
    if (process->dead) return;
    bool arrived = false;
    const bool heard = run(process, {"upload"}, [&](Coordinator&) {
      try {
        const auto upload = std::move(process->uploads.at(number));
        upload->append(rest, world_.loop.now());
        arrived = upload->finish(world_.loop.now());
      } catch (const coordinator::BlobError& error) {
        world_.journal.say("coordinator", "refuses upload {:.8}: {}", digest, error.what());
      }
    });
    process->uploads.erase(number);
    if (heard) reply(arrived);
  });
}

// --- how it ends -------------------------------------------------------------------------------------------------

/// A sync or a failpoint of the code that runs.
void Leader::pass(const std::string& point) {
  if (running_ != present_ || running_->dead || until_crash_ == 0 || --until_crash_ > 0) return;
  world_.journal.say("coordinator", "{} at \"{}\"", crash_cuts_power_ ? "loses its power" : "is killed", point);
  if (point != "sync") world_.crashed_at.insert(point);
  world_.injected.count(crash_cuts_power_ ? Fault::kCutCoordinatorsPowerAt : Fault::kKillCoordinatorAt);
  end(crash_cuts_power_);
}

/// The disk is what it is now; whatever the code that runs still does comes too late.
void Leader::end(bool power_cut) {
  until_crash_ = 0;
  world_.power_cuts += power_cut;
  left_ = power_cut ? world_.disk.after_power_cut(present_->folder, world_.random) : world_.disk.after_kill(present_->folder);
  present_->dead = true;
}

void Leader::bury() {
  for (const auto& process : {std::exchange(outdated_, nullptr), std::exchange(present_, nullptr)}) {
    if (!process) continue;
    process->dead = true;
    process->uploads.clear();
    process->coordinator.reset();
    world_.disk.remove(process->folder);
  }
  world_.disk.locks_hold = true;
  world_.checks->stopped();
  restart_later();
}

void Leader::restart_later() {
  const Time away = world_.calm                 ? kSecond
                    : world_.random.chance(0.3) ? world_.time(5 * kSecond, 15 * kSecond)
                                                : world_.time(kMillisecond, 2 * kSecond);
  world_.loop.after(away, [this] {
    if (!present_ && !world_.violation) start();
  });
}

void Leader::crash(bool power_cut) {
  if (!present_ || running_) return;
  world_.journal.say("coordinator", "{}", power_cut ? "loses its power" : "is killed");
  end(power_cut);
  bury();
}

void Leader::crash_at(int n, bool power_cut) {
  until_crash_ = n;
  crash_cuts_power_ = power_cut;
}

void Leader::stop() {
  if (!present_ || running_) return;
  world_.journal.say("coordinator", "stops");
  world_.injected.count(Fault::kStopCoordinator);
  until_crash_ = 0;
  present_->uploads.clear();
  running_ = present_;
  present_->coordinator.reset();
  running_ = nullptr;
  left_ = world_.disk.after_kill(present_->folder);
  bury();
}

void Leader::replace() {
  if (!present_ || outdated_ || running_) return;
  world_.journal.say("coordinator", "is replaced and goes on");
  ++world_.outdated_leaders;
  world_.injected.count(Fault::kReplaceLeader);
  outdated_ = present_;
  outdated_->outdated = true;
  until_crash_ = 0;
  world_.checks->stopped();
  const auto process = std::make_shared<Process>();
  process->life = ++lives_;
  process->folder = outdated_->folder;
  present_ = process;
  world_.disk.locks_hold = false;
  running_ = process;
  const auto error = rpc::failure_of([&] { process->coordinator = std::make_unique<Coordinator>(options_of(process)); });
  running_ = nullptr;
  world_.disk.locks_hold = true;
  if (error) return world_.violate("the other coordinator does not start: " + *error);
  world_.checks->started(*process->coordinator);
  keep_stepping(process);
  write_later(process);
}

bool Leader::idle() {
  if (!present_ || CoordinatorInside::store(*present_->coordinator).backlog() > 0 || !present_->uploads.empty()) return false;
  return !CoordinatorInside::merges(*present_->coordinator);
}

std::optional<std::string> Leader::open_task() {
  if (!present_) return std::nullopt;
  for (const auto& [id, job] : CoordinatorInside::scheduler(*present_->coordinator).jobs())
    for (size_t f = 0; f < job.frames.size(); ++f) {
      const coordinator::Frame& frame = job.frames[f];
      const auto number = frame.tasks.next_open(world_.random.below(std::max<int64_t>(frame.tasks.size(), 1)), frame.tasks.size());
      if (number) return to_string(coordinator::TaskRef{id, static_cast<int>(f), *number});
    }
  return std::nullopt;
}

bool Leader::damage(const std::string& digest) {
  if (!present_) return false;
  const std::string path = present_->coordinator->blobs().path(digest);
  std::FILE* file = std::fopen(path.c_str(), "r+b");
  if (!file) return false;
  std::fseek(file, static_cast<long>(world_.random.between(10, 120)), SEEK_SET);
  std::fputc('#', file);
  std::fclose(file);
  return true;
}

}  // namespace woodcock::simulator
