#include "coordinator/coordinator.h"

#include <time.h>

#include <spdlog/spdlog.h>

#include <chrono>

#include "coordinator/coordinator_locked.h"
#include "coordinator/job_view.h"
#include "rpc/limits.h"
#include "rpc/manifest.h"

namespace woodcock::coordinator {

Time boot_time() {
  timespec time{};
  ::clock_gettime(CLOCK_BOOTTIME, &time);
  return time.tv_sec * kSecond + time.tv_nsec;
}

int64_t unix_time_ms() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
}

Coordinator::Coordinator(const CoordinatorOptions& options)
    : options_(options),
      blobs_({options.dir, options.min_free_bytes, options.pin, options.failpoint}, options.now()),
      store_(std::make_unique<Store>(StoreOptions{options.dir, options.address, options.on_fatal})),
      address_(options.address),
      leader_id_(random_id().substr(0, 16)) {
  SchedulerOptions scheduler = options.scheduler;
  scheduler.leader_term = store_->term();
  scheduler.leader_id = leader_id_;
  spdlog::info("cluster {}, leader term {}", store_->cluster_id(), store_->term());
  scheduler_ = std::make_unique<Scheduler>(scheduler);
  recover();
  for (int i = 0; i < options.merges_at_once; ++i) assemblers_.emplace_back([this] { run_assembler(); });
  ticker_ = std::thread([this] { run_ticker(); });
}

void Coordinator::recover() {
  const std::vector<RecoveredJob> jobs = store_->read([](StoreSession& s) { return s.load_jobs(); });
  const std::vector<LeaseRow> leases = store_->read([](StoreSession& s) { return s.load_leases(); });
  const Time now = options_.now();
  locked([&] {
    std::map<std::string, std::vector<LeaseRow>> by_job;
    for (const LeaseRow& lease : leases) by_job[lease.task.job].push_back(lease);
    for (const RecoveredJob& job : jobs) {
      last_event_[job.spec.id] = job.row.last_event;
      scheduler_->recover_job(job, by_job[job.spec.id], now);
    }
  });
  if (!jobs.empty()) spdlog::info("recovered {} jobs and {} leases, leader term {}", jobs.size(), leases.size(), store_->term());
}

Coordinator::~Coordinator() {
  stop_syncs();
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_assembler_.notify_all();
  wake_ticker_.notify_all();
  for (std::thread& assembler : assemblers_) assembler.join();
  ticker_.join();
  store_->stop();
}

void Coordinator::set_address(const std::string& address) {
  const std::lock_guard lock(mutex_);
  address_ = address;
}

Coordinator::Completions Coordinator::pump() {
  Completions completions;
  // Answers may lease and so make new actions, which change what other held calls are told.
  for (std::vector<Action> actions = scheduler_->take_actions();;) {
    for (const Action& action : actions)
      if (const auto error = rpc::failure_of([&] { carry_out(action); })) spdlog::error("carrying out a decision failed: {}", *error);
    for (auto it = held_.begin(); it != held_.end();) {
      bool answered = false;
      if (const auto error = rpc::failure_of([&] { answered = try_answer(it->first, it->second, completions); })) {
        spdlog::error("no answer for worker {}: {}", it->first, *error);
        completions.push_back([done = it->second.done, error] { done({rpc::Code::kInternal, *error}, {}); });
        answered = true;
      }
      it = answered ? held_.erase(it) : std::next(it);
    }
    actions = scheduler_->take_actions();
    if (actions.empty()) break;
  }
  return completions;
}

namespace {

template <typename... F>
struct Overloaded : F... {
  using F::operator()...;
};
template <typename... F>
Overloaded(F...) -> Overloaded<F...>;

}  // namespace

void Coordinator::carry_out(const Action& any) {
  const auto changed = [&] { ++changes_; };
  std::visit(
      Overloaded{
          [&](const action::PinFrame& pin) {
            const auto keys = scheduler_->keys_of_open_tasks(pin);
            FrameRow row = must_find(pin.job).frames[static_cast<size_t>(pin.frame)].row;
            row.pinned = true;
            row.build = pin.build;
            row.arithmetic_class = pin.arithmetic_class;
            auto reused = std::make_shared<std::vector<SettledTask>>();
            store_->write(
                [this, pin, keys, row, reused](StoreSession& session) {
                  session.save_frame(pin.job, pin.frame, row);
                  for (const auto& [number, key] : keys) {
                    const std::optional<ResultRecord> found = session.find_result(key);
                    if (!found || !blobs_.contains(found->digest)) continue;
                    SettledTask task;
                    task.frame = pin.frame;
                    task.number = number;
                    task.result = *found;
                    task.reused = true;  // paid for by the job that rendered it
                    if (session.settle_task({pin.job, pin.frame, number}, task)) reused->push_back(task);
                  }
                },
                [this, pin, reused] {
                  locked([&] {
                    scheduler_->frame_pinned(pin, *reused);
                    ++changes_;
                  });
                });
          },
          [&](const action::CommitTask& commit) {
            const int64_t parent = must_find(commit.task.job)
                                       .frames[static_cast<size_t>(commit.task.frame)]
                                       .tasks[static_cast<size_t>(commit.task.number)]
                                       .parent;
            auto won = std::make_shared<bool>(false);
            store_->write(
                [this, commit, parent, won](StoreSession& session) {
                  *won = session.commit_task(commit.task, parent, commit.result);
                  options_.failpoint("in-commit");
                },
                [this, commit, won] {
                  // One leader writes: a task that is open here has no row there, unless the two have parted.
                  if (!*won) options_.on_fatal("task " + to_string(commit.task) + " is settled in the database and open in memory");
                  options_.failpoint("after-commit");
                  locked([&] {
                    scheduler_->committed(commit, options_.now());
                    ++changes_;
                  });
                });
          },
          [&](const action::SplitTask& split) {
            changed();
            SettledTask row;
            row.state = TaskState::Split;
            row.first_part = split.first_part;
            store_->write([task = split.task, row](StoreSession& session) { session.settle_task(task, row); });
          },
          [&](const action::GiveUpTask& give_up) {
            SettledTask row;
            row.state = TaskState::GivenUp;
            row.error = give_up.error;
            store_->write([task = give_up.task, row](StoreSession& session) { session.settle_task(task, row); });
          },
          [&](const action::RecordAttempt& record) {
            changed();
            AttemptRecord attempt = record.attempt;
            attempt.unix_ms = options_.unix_ms();
            store_->write([task = record.task, attempt](StoreSession& session) { session.add_attempt(task, attempt); });
          },
          [&](const action::SaveLease& save) { store_->write([lease = save.lease](StoreSession& session) { session.save_lease(lease); }); },
          [&](const action::DropLease& drop) {
            changed();
            store_->write([id = drop.lease_id](StoreSession& session) { session.drop_lease(id); });
          },
          [&](const action::AssembleFrame& assemble) {
            to_assemble_.push_back({assemble.job, assemble.frame, 0, 0});
            wake_assembler_.notify_one();
          },
          [&](const action::SaveJob& save) {
            changed();
            const Job& job = must_find(save.job);
            if (has_ended(job.row.state) && job.row.ended_unix_ms == 0) scheduler_->set_ended_time(save.job, options_.unix_ms());
            spdlog::info("job {} {}{}{}", save.job, to_string(job.row.state), job.row.reason.empty() ? "" : ": ", job.row.reason);
            store_->write([spec = job.spec, row = job.row](StoreSession& session) { session.save_job(spec, row); });
          },
          [&](const action::SaveFrame& save) {
            const FrameRow& row = must_find(save.job).frames[static_cast<size_t>(save.frame)].row;
            std::function<void()> done;
            if (has_ended(row.state)) done = [this] { options_.failpoint("after-frame-row"); };
            store_->write([save, row](StoreSession& session) { session.save_frame(save.job, save.frame, row); }, std::move(done));
          },
          [&](const action::ResetFrame& reset) {
            changed();
            const FrameRow& row = must_find(reset.job).frames[static_cast<size_t>(reset.frame)].row;
            store_->write([reset, row](StoreSession& session) {
              session.reset_frame(reset.job, reset.frame);
              session.save_frame(reset.job, reset.frame, row);
            });
          },
          [&](const action::LogEvent& log) {
            JobEvent event = log.event;
            event.number = ++last_event_[log.job];
            event.unix_ms = options_.unix_ms();
            store_->write([job = log.job, event](StoreSession& session) { session.append_event(job, event); });
          },
      },
      any);
}

size_t Coordinator::sweep() {
  std::set<std::string> referenced = store_->read([](StoreSession& session) { return session.referenced_blobs(); });
  const std::set<std::string> manifests = store_->read([](StoreSession& session) { return session.manifests(); });
  for (const std::string& digest : manifests) {
    try {
      const v1::SceneManifest manifest = rpc::parse_manifest(blobs_.read(digest, rpc::kMaxManifestBytes));
      for (const v1::SceneFile& file : manifest.files()) referenced.insert(file.content_digest());
    } catch (const std::exception& error) {
      // What it lists is unknown: nothing may be removed.
      spdlog::error("clean-up skipped, manifest {} cannot be read: {}", digest, error.what());
      return 0;
    }
  }
  return blobs_.sweep(referenced, options_.now(), [](const std::string& warning) { spdlog::warn("clean-up: {}", warning); });
}

std::string Coordinator::lacking(const std::string& manifest_digest) const {
  const std::string advice = " is damaged or missing on the coordinator: submit the scene again, then this job goes on";
  v1::SceneManifest manifest;
  if (rpc::failure_of([&] { manifest = rpc::parse_manifest(blobs_.read(manifest_digest, rpc::kMaxManifestBytes)); }))
    return "the list of the scene's files" + advice;
  for (const v1::SceneFile& file : manifest.files())
    if (!blobs_.contains(file.content_digest())) return "the scene's file " + file.path() + advice;
  return {};
}

void Coordinator::blob_lost(const std::string& digest) {
  std::string why;
  if (blobs_.verify(digest, &why)) return;
  if (blobs_.contains(digest)) spdlog::error("a blob is thrown away: {}", why);
  blobs_.remove(digest);
  std::set<std::string> manifests;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [id, job] : scheduler_->jobs()) {
      if (has_ended(job.row.state)) continue;
      for (const Frame& frame : job.frames)
        if (!has_ended(frame.row.state)) manifests.insert(frame.spec.manifest_digest);
    }
  }
  for (const std::string& manifest : manifests) {
    const std::string reason = lacking(manifest);
    if (reason.empty()) continue;
    locked([&] {
      if (!scheduler_->lost_scenes().contains(manifest)) spdlog::error("{}", reason);
      scheduler_->scene_lost(manifest, reason);
      ++changes_;
    });
  }
}

void Coordinator::look_for_lost_scenes() {
  std::map<std::string, std::string> lost;
  {
    const std::lock_guard lock(mutex_);
    lost = scheduler_->lost_scenes();
  }
  for (const auto& [manifest, reason] : lost) {
    if (!lacking(manifest).empty()) continue;
    spdlog::info("the scene of manifest {} is whole again", manifest);
    locked([&] {
      scheduler_->scene_found(manifest);
      ++changes_;
    });
  }
}

void Coordinator::run_ticker() {
  Time next_second = 0, next_sweep = options_.now() + options_.pin;
  std::string shortage;
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    wake_ticker_.wait_for(lock, std::chrono::milliseconds(100));
    if (stopping_) return;
    lock.unlock();
    const Time now = options_.now();
    const auto every_second = [&] {
      const std::string found = blobs_.shortage();
      if (found != shortage) spdlog::warn("{}", found.empty() ? "there is room on the disk again" : found);
      shortage = found;
      look_for_lost_scenes();
      locked([&] {
        scheduler_->hold_leasing(shortage);
        scheduler_->tick(now);
        ++changes_;
      });
    };
    const auto clean_up = [&] {
      if (const size_t removed = sweep(); removed > 0) spdlog::info("clean-up removed {} files", removed);
    };
    const auto answer_overdue = [&] { locked([] {}); };
    if (now >= next_second) {
      next_second = now + kSecond;
      if (const auto error = rpc::failure_of(every_second)) spdlog::error("the tick failed: {}", *error);
    } else if (const auto error = rpc::failure_of(answer_overdue)) {
      spdlog::error("the tick failed: {}", *error);
    }
    if (now >= next_sweep) {
      next_sweep = now + 600 * kSecond;
      if (const auto error = rpc::failure_of(clean_up)) spdlog::error("the clean-up failed: {}", *error);
    }
    lock.lock();
  }
}

}  // namespace woodcock::coordinator
