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

namespace {

StoreOptions store_options(const CoordinatorOptions& options) {
  StoreOptions store{options.dir, options.address, options.on_fatal};
  store.make_id = options.make_id;
  store.failpoint = options.failpoint;
  store.own_thread = options.own_threads;
  store.batch = options.store_batch;
  // How far a transaction reaches is then not a matter of time.
  if (!options.own_threads) store.longest_batch = std::chrono::hours(1);
  return store;
}

}  // namespace

Coordinator::Coordinator(const CoordinatorOptions& options)
    : options_(options),
      blobs_({options.dir, options.min_free_bytes, options.pin, options.failpoint}, options.now()),
      store_(std::make_unique<Store>(store_options(options))),
      address_(options.address),
      leader_id_(options.make_id().substr(0, 16)) {
  SchedulerOptions scheduler = options.scheduler;
  scheduler.leader_term = store_->term();
  scheduler.leader_id = leader_id_;
  spdlog::info("cluster {}, leader term {}", store_->cluster_id(), store_->term());
  scheduler_ = std::make_unique<Scheduler>(scheduler);
  started_ = options.now();
  started_unix_ms_ = options.unix_ms();
  recover();
  if (!options.own_threads) return;
  for (int i = 0; i < options.merges_at_once; ++i) assemblers_.emplace_back([this] { run_assembler(); });
  ticker_ = std::thread([this] { run_ticker(); });
  housekeeper_ = std::thread([this] { run_housekeeper(); });
}

void Coordinator::recover() {
  const std::vector<std::string> running = store_->look([](StoreSession& s) { return s.running_jobs(); });
  const std::vector<LeaseRow> leases = store_->look([](StoreSession& s) { return s.load_leases(); });
  std::map<std::string, std::vector<LeaseRow>> by_job;
  for (const LeaseRow& lease : leases) by_job[lease.task.job].push_back(lease);
  const Time now = options_.now();
  for (const std::string& id : running) {
    std::optional<LoadedJob> loaded = store_->load_job(id);
    if (!loaded) continue;
    store_->load_tasks(loaded->job);
    locked([&] { scheduler_->recover_job(std::move(loaded->job), by_job[id], now); });
    by_job.erase(id);
  }
  for (const auto& [id, lost] : by_job)
    for (const LeaseRow& lease : lost) store_->write([lease = lease.lease_id](StoreSession& session) { session.drop_lease(lease); });
  if (!running.empty()) spdlog::info("recovered {} jobs and {} leases, leader term {}", running.size(), leases.size(), store_->term());
}

Coordinator::~Coordinator() {
  stop_syncs();
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_assembler_.notify_all();
  wake_ticker_.notify_all();
  wake_housekeeper_.notify_all();
  for (std::thread& assembler : assemblers_) assembler.join();
  if (ticker_.joinable()) ticker_.join();
  if (housekeeper_.joinable()) housekeeper_.join();
  // Of merges that were cut off.
  if (const auto error = rpc::failure_of([&] { blobs_.clear_temporary(); })) spdlog::warn("{}", *error);
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
  answered_holds_.clear();
  return completions;
}

std::shared_ptr<BlobStore::Hold> Coordinator::hold_of(const std::string& worker_id) const {
  if (const auto call = held_.find(worker_id); call != held_.end()) return call->second.hold;
  const auto answered = answered_holds_.find(worker_id);
  return answered == answered_holds_.end() ? nullptr : answered->second;
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
            store_->write([pin](StoreSession& session) { session.save_frame(pin.job, pin.frame, pin.row); },
                          [this, pin] {
                            options_.failpoint("frame-pinned");  // durable, no lease is granted
                            locked([&] {
                              scheduler_->frame_pinned(pin);
                              ++changes_;
                            });
                          });
          },
          [&](const action::FindResults& find) { find_results(find); },
          [&](const action::CommitTask& commit) {
            auto won = std::make_shared<bool>(false);
            const auto hold = hold_of(commit.worker_id);  // until the row is durable
            store_->write(
                [this, commit, won](StoreSession& session) {
                  *won = session.commit_task(commit.task, commit.parent, commit.result);
                  options_.failpoint("in-commit");  // a result's rows are written, their transaction is open
                },
                [this, commit, won, hold] {
                  // One leader writes: a task that is open here has no row there, unless the two have parted.
                  if (!*won) options_.on_fatal("task " + to_string(commit.task) + " is settled in the database and open in memory");
                  options_.failpoint("after-commit");  // the transaction is durable, nobody knows
                  locked([&] {
                    scheduler_->committed(commit, options_.now());
                    tell_committed(commit);
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
            JobRow row = save.row;
            if (has_ended(row.state) && row.ended_unix_ms == 0)
              scheduler_->set_ended_time(save.job, row.ended_unix_ms = options_.unix_ms());
            spdlog::info("job {} {}{}{}", save.job, to_string(row.state), row.reason.empty() ? "" : ": ", row.reason);
            store_->write([id = save.job, aim = save.aim, row](StoreSession& session) { session.save_job(id, aim, row); });
          },
          [&](const action::SaveFrame& save) {
            std::function<void()> done;
            if (has_ended(save.row.state)) done = [this] { options_.failpoint("after-frame-row"); };  // durable, nobody knows
            store_->write([save](StoreSession& session) { session.save_frame(save.job, save.frame, save.row); }, std::move(done));
          },
          [&](const action::ResetFrame& reset) {
            changed();
            store_->write([reset, ms = options_.unix_ms()](StoreSession& session) {
              session.reset_frame(reset.job, reset.frame, ms);
              session.save_frame(reset.job, reset.frame, reset.row);
            });
          },
          [&](const action::LogEvent& log) {
            JobEvent event = log.event;
            event.unix_ms = options_.unix_ms();
            if (event.kind == EventKind::Waiting) spdlog::info("job {} {}", log.job, event.message);
            store_->write([job = log.job, event](StoreSession& session) { session.append_event(job, event); });
          },
          [&](const action::FindJob& find) { find_job(find.job); },
          [&](const action::ReleaseJob& ended) { store_->write([](StoreSession&) {}, [this, id = ended.job] { release(id); }); },
      },
      any);
}

void Coordinator::find_results(const action::FindResults& find) {
  auto reused = std::make_shared<std::vector<SettledTask>>();
  const auto hold = std::make_shared<BlobStore::Hold>(blobs_);
  store_->write(
      [this, find, reused, hold](StoreSession& session) {
        for (const auto& [number, area] : find.tasks) {
          const std::optional<ResultRecord> found = session.find_result(result_key(find.header, area.rect, area.range));
          if (!found) continue;
          // Held before it is looked for, until the row is durable: a clean-up in between must not take it.
          hold->add(found->digest);
          if (!blobs_.contains(found->digest)) continue;
          SettledTask task;
          task.frame = find.frame;
          task.number = number;
          task.result = *found;
          task.reused = true;  // paid for by the job that rendered it
          if (session.settle_task({find.job, find.frame, number}, task)) reused->push_back(task);
        }
      },
      [this, find, reused, hold] {
        locked([&] {
          scheduler_->results_found(find, *reused);
          ++changes_;
        });
      });
}

void Coordinator::find_job(const std::string& id) {
  auto state = std::make_shared<std::optional<JobState>>();
  store_->write(
      [id, state](StoreSession& session) {
        if (const std::optional<StoredJob> job = session.find_job(id)) *state = job->row.state;
      },
      [this, id, state] {
        locked([&] {
          scheduler_->job_found(id, *state);
          ++changes_;
        });
      });
}

/// All that was decided about the job before is durable: from now on the database alone has it.
void Coordinator::release(const std::string& id) {
  // It goes when the lock is given back: a job of many frames takes a while.
  const std::optional<Job> job = locked([&] {
    std::optional<Job> released = scheduler_->release(id);
    if (released) {
      std::vector<FrameCounts> frames;
      for (const Frame& frame : released->frames) frames.push_back(counts_of(*released, frame));
      store_->write_counts(id, summary_of(*released), frames);
    }
    return released;
  });
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

void Coordinator::tick() {
  const std::string found = blobs_.shortage();
  if (found != shortage_) spdlog::warn("{}", found.empty() ? "there is room on the disk again" : found);
  shortage_ = found;
  look_for_lost_scenes();
  locked([&] {
    scheduler_->hold_leasing(shortage_);
    scheduler_->tick(options_.now());
    ++changes_;
  });
}

void Coordinator::answer_overdue() {
  locked([] {});
}

void Coordinator::run_ticker() {
  Time next_second = 0;
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    wake_ticker_.wait_for(lock, std::chrono::milliseconds(100));
    if (stopping_) return;
    lock.unlock();
    const Time now = options_.now();
    if (now >= next_second) {
      next_second = now + kSecond;
      if (const auto error = rpc::failure_of([&] { tick(); })) spdlog::error("the tick failed: {}", *error);
    } else if (const auto error = rpc::failure_of([&] { answer_overdue(); })) {
      spdlog::error("the tick failed: {}", *error);
    }
    lock.lock();
  }
}

}  // namespace woodcock::coordinator
