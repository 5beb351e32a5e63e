#include "tests/service/simulator/worker.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

#include "renderer/film/atomic_file.h"
#include "rpc/convert.h"
#include "rpc/limits.h"
#include "rpc/manifest.h"
#include "tests/service/simulator/leader.h"
#include "tests/service/simulator/rendering.h"

namespace woodcock::simulator {
namespace {

constexpr Time kOffering = kSecond, kYoungCall = 5 * kMillisecond;
constexpr Time kDeadline = 30 * kSecond;
constexpr int kMaxAborts = 5;

}  // namespace

Worker::Worker(World& world, int number, std::string build)
    : world_(world),
      id_(fmt::format("w{}", number)),
      build_(std::move(build)),
      slots_(static_cast<int>(world.random.between(1, 2))),
      clock_offset_(world.random.between(0, 100'000) * kSecond) {
  start();
}

void Worker::start() {
  ++life_;
  ++incarnation_;
  folder_ = world_.folder / fmt::format("{}-{}", id_, life_);
  world_.disk.lay_out(std::exchange(left_, {}), folder_);
  spool_ = std::make_unique<Spool>(folder_);
  book_ = std::make_unique<LeaseBook>(*spool_);
  frozen_ = draining_ = fetching_ = uploading_ = answered_ = false;
  missed_.clear();
  leader_ = {};
  highest_term_ = sequence_ = news_ = 0;
  call_.reset();
  busy_slots_ = failures_ = aborts_ = 0;
  sync_at_ = world_.loop.now();
  world_.journal.say(id_, "starts with {} results in its spool", book_->unacknowledged_results());
  look_around();
}

void Worker::crash(bool power_cut) {
  if (!book_) return;
  world_.journal.say(id_, "{}", power_cut ? "loses its power" : "is killed");
  ++life_;
  left_ = power_cut ? world_.disk.after_power_cut(folder_, world_.random) : world_.disk.after_kill(folder_);
  book_.reset();
  spool_.reset();
  world_.disk.remove(folder_);
  world_.loop.after(world_.calm ? kSecond : world_.time(100 * kMillisecond, 12 * kSecond), [this, life = life_] {
    if (life == life_) start();
  });
}

void Worker::freeze() {
  if (!book_ || frozen_) return;
  world_.journal.say(id_, "is frozen");
  world_.injected.count(Fault::kFreezeWorker);
  frozen_ = true;
}

void Worker::go_on() {
  if (!book_ || !frozen_) return;
  world_.journal.say(id_, "goes on");
  frozen_ = false;
  const uint64_t life = life_;
  for (auto& work : std::exchange(missed_, {})) {
    if (life != life_) return;
    work();
  }
}

void Worker::drain() {
  if (!book_ || draining_ || frozen_) return;
  world_.journal.say(id_, "drains");
  world_.injected.count(Fault::kDrainWorker);
  draining_ = true;
  drain_end_ = world_.loop.now() + 5 * kSecond;
  book_->drain();
}

void Worker::later(Time delay, std::function<void()> work) {
  world_.loop.after(delay, [this, life = life_, work = std::move(work)]() mutable {
    if (life != life_) return;
    if (frozen_)
      missed_.push_back(std::move(work));
    else
      work();
  });
}

/// What its threads look at ten times a second.
void Worker::look_around() {
  act();
  if (!book_) return;
  later(world_.time(100 * kMillisecond, 200 * kMillisecond), [this] { look_around(); });
}

void Worker::act() {
  const BootTime now = boot();
  for (const std::string& note : book_->expire(now)) world_.journal.say(id_, "{}", note);
  if (draining_) {
    if (world_.loop.now() >= drain_end_) book_->stop_rendering();
    if (book_->idle() || world_.loop.now() >= drain_end_ + 5 * kSecond) return crash(false);
  }
  if (!fetching_)
    if (const auto grant = book_->next_to_fetch()) fetch(*grant);
  while (busy_slots_ < slots_) {
    const auto grant = book_->next_to_render();
    if (!grant) break;
    ++busy_slots_;
    const Time total = world_.goes_wrong(Mishap::kAttemptSlow, world_.plan.straggle) ? world_.time(5 * kSecond, 15 * kSecond)
                                                                                     : world_.time(300 * kMillisecond, 3 * kSecond);
    render(std::make_shared<v1::LeaseGrant>(*grant), total);
  }
  if (!uploading_)
    if (const auto offer = book_->next_to_upload(now)) upload(*offer);

  const bool news = book_->news() != (call_ ? call_->news : news_) || draining_ != (call_ ? call_->draining : draining_);
  const auto shortest = book_->shortest_duration();
  const Time renewal = shortest ? std::chrono::nanoseconds(*shortest).count() / 3 : kDeadline;
  if (call_) {
    const Time age = world_.loop.now() - call_->sent;
    const Time patience = call_->request.offers().empty() ? kYoungCall : kOffering;
    if ((news && age >= patience) || age >= renewal)
      cut_call();
    else if (age >= kDeadline)
      call_failed(rpc::Code::kDeadlineExceeded, "no answer in time");
  }
  if (!call_ && (world_.loop.now() >= sync_at_ || (answered_ && news))) sync();
}

// --- syncing -----------------------------------------------------------------------------------------------------

v1::SyncRequest Worker::make_request() {
  v1::SyncRequest request;
  *request.mutable_protocol() = rpc::this_protocol();
  request.set_worker_id(id_);
  request.set_incarnation(incarnation_);
  request.set_host_name("host-of-" + id_);
  request.set_sequence(++sequence_);
  request.set_build(build_);
  request.set_arithmetic_class("class");
  request.set_slots(static_cast<uint32_t>(slots_));
  request.set_threads(1);
  request.set_state(draining_ ? v1::WORKER_STATE_DRAINING : v1::WORKER_STATE_READY);
  leader_.fill(request);
  return request;
}

void Worker::sync() {
  Call call;
  call.number = ++calls_;
  call.news = news_ = book_->news();
  call.draining = draining_;
  call.sent = world_.loop.now();
  call.sent_at = boot();
  call.request = make_request();
  book_->fill(call.request, boot());
  answered_ = false;
  call_ = std::move(call);
  const auto number = call_->number;
  const auto request = std::make_shared<v1::SyncRequest>(call_->request);
  world_.send(id_, Way::kToCoordinator, [this, number, request, life = life_] {
    world_.leader->sync(number, *request, [this, number, life](const rpc::Outcome& outcome, const v1::SyncResponse& response) {
      world_.send(id_, Way::kFromCoordinator, [this, number, life, outcome, response] {
        if (life == life_) later(0, [this, number, outcome, response] { take_answer(number, outcome, response); });
      });
    });
  });
}

/// There is something to say.
void Worker::cut_call() {
  const uint64_t number = call_->number;
  call_.reset();
  sync_at_ = world_.loop.now();
  world_.send(id_, Way::kToCoordinator, [this, number] { world_.leader->cancel_sync(id_, number); });
}

void Worker::call_failed(rpc::Code code, const std::string& message) {
  call_.reset();
  answered_ = false;
  if (code == rpc::Code::kInvalidArgument || code == rpc::Code::kFailedPrecondition || code == rpc::Code::kInternal)
    return world_.violate(fmt::format("{} is answered {}: {}", id_, rpc::code_name(code), message));
  if (code == rpc::Code::kAborted && ++aborts_ >= kMaxAborts) {
    world_.journal.say(id_, "ends: another process uses its identity");
    return crash(false);
  }
  const Time pause = std::min<Time>((200 * kMillisecond) << std::min(failures_++, 6), 10 * kSecond);
  sync_at_ = world_.loop.now() + world_.time(pause / 2, pause);
}

void Worker::take_answer(uint64_t number, const rpc::Outcome& outcome, const v1::SyncResponse& response) {
  if (!call_ || call_->number != number) return;
  if (!outcome.ok()) {
    world_.journal.say(id_, "is answered {}: {}", rpc::code_name(outcome.code), outcome.message);
    return call_failed(outcome.code, outcome.message);
  }
  const Call call = std::move(*call_);
  call_.reset();
  const LeaderSeen::Answer answer = leader_.recognize(response);
  if (answer == LeaderSeen::Answer::kOutdated) {
    world_.journal.say(id_, "leaves aside an answer of leader term {}", response.leader_term());
    return call_failed(rpc::Code::kUnavailable, "outdated");
  }
  if (response.leader_term() < highest_term_)
    world_.violate(fmt::format("{} takes in an answer of leader term {} after one of {}", id_, response.leader_term(), highest_term_));
  highest_term_ = response.leader_term();
  failures_ = aborts_ = 0;
  answered_ = true;
  sync_at_ = world_.loop.now();
  if (!answers(response, call.request)) return;
  for (const std::string& note : book_->apply(call.request, call.sent_at, response, boot())) world_.journal.say(id_, "{}", note);
  for (const v1::LeaseGrant& grant : response.grants())
    world_.journal.say(id_, "has lease {} of task {}", grant.lease_id(), grant.task().task_id());
  Time pause = std::clamp<Time>(response.next_sync_ms(), 0, 10'000) * kMillisecond;
  if (const auto shortest = book_->shortest_duration()) pause = std::min<Time>(pause, std::chrono::nanoseconds(*shortest).count() / 3);
  sync_at_ += pause;
  act();
}

void Worker::forge() {
  if (!book_) return;
  v1::SyncRequest request = make_request();
  v1::SyncRequest truth;
  book_->fill(truth, boot());
  const uint64_t term = std::max<uint64_t>(leader_.leader_term(), 1);
  for (const v1::LeaseReport& lease : truth.leases()) {
    const uint64_t other = world_.random.chance(0.5) ? lease.epoch() - 1 : lease.epoch() - (uint64_t{1} << 32);
    switch (world_.random.below(3)) {
      case 0: {
        v1::LeaseReport& report = *request.add_leases();
        report = lease;
        report.set_epoch(other);
        report.set_renewal_counter(lease.renewal_counter() + static_cast<uint64_t>(world_.random.between(1, 1000)));
        break;
      }
      case 1: {
        v1::FailureReport& report = *request.add_failures();
        report.set_lease_id(lease.lease_id());
        report.set_task_id(lease.task_id());
        report.set_epoch(other);
        report.set_cause(v1::FAILURE_CAUSE_CRASH);
        break;
      }
      default: {
        v1::LeaseRelease& release = *request.add_releases();
        release.set_lease_id(lease.lease_id());
        release.set_task_id(lease.task_id());
        release.set_epoch(other);
      }
    }
  }
  // Nobody granted this: it claims to be of this very leader, or of an earlier one, with an epoch below any that was given out.
  if (const std::optional<std::string> task = world_.leader->open_task()) {
    v1::LeaseReport& report = *request.add_leases();
    const bool of_this_leader = world_.random.chance(0.5);
    const uint64_t claimed = of_this_leader ? (term << 32) + 1'000'000 : ((term - 1) << 32) + 1;
    report.set_lease_id(fmt::format("L{}-{}-forged{}", claimed >> 32, claimed & 0xffffffff, world_.random.below(1000)));
    report.set_task_id(*task);
    report.set_epoch(claimed);
    report.set_renewal_counter(1);
    report.set_phase(v1::LEASE_PHASE_RENDERING);
  }
  world_.injected.count(Fault::kStaleReports);
  world_.journal.say(id_, "is spoken for by somebody else: {} leases, {} failures, {} releases", request.leases_size(),
                     request.failures_size(), request.releases_size());
  world_.leader->sync(++calls_, request, [](const rpc::Outcome&, const v1::SyncResponse&) {});
}

// --- work --------------------------------------------------------------------------------------------------------

void Worker::fetch(const v1::LeaseGrant& grant) {
  fetching_ = true;
  later(world_.time(kMillisecond, 300 * kMillisecond), [this, grant] {
    fetching_ = false;
    if (book_->should_stop(grant.lease_id(), boot())) return book_->stopped(grant);
    if (world_.goes_wrong(Mishap::kSceneLost, world_.plan.lose_scene)) {
      world_.journal.say(id_, "cannot fetch the scene of task {}", grant.task().task_id());
      return book_->failed(grant, {FailureCause::kTransfer, "the scene cannot be fetched"}, "");
    }
    book_->fetch_moved(grant.lease_id());
    book_->fetched(grant.lease_id());
    act();
  });
}

bool Worker::is_poison(const v1::TaskSpec& task) const {
  const v1::PixelRect& rect = task.rect();
  return world_.plan.poison && task.settings().seed() == 1 && task.header().frame() == 0 && rect.x0() <= 3 && 3 < rect.x1() &&
         rect.y0() <= 3 && 3 < rect.y1() && task.range().begin() <= 5 && 5 < task.range().end();
}

void Worker::render(const std::shared_ptr<v1::LeaseGrant>& grant, Time left) {
  const Time slice = std::min(left, world_.time(200 * kMillisecond, kSecond));
  later(slice, [this, grant, left = left - slice] {
    if (book_->should_stop(grant->lease_id(), boot())) {
      --busy_slots_;
      book_->stopped(*grant);
      return act();
    }
    if (left > 0) {
      book_->progressed(grant->lease_id(), {"rendering", static_cast<uint64_t>(world_.loop.now()), 0});
      return render(grant, left);
    }
    --busy_slots_;
    end_attempt(*grant);
    act();
  });
}

void Worker::end_attempt(const v1::LeaseGrant& grant) {
  const v1::TaskSpec& task = grant.task();
  const bool poison = is_poison(task);
  if (poison) world_.injected.count(Mishap::kAttemptCrashed);
  if (poison || world_.goes_wrong(Mishap::kAttemptCrashed, world_.plan.crash_task)) {
    ++world_.failed_attempts;
    world_.journal.say(id_, "crashes at task {}", task.task_id());
    return book_->failed(grant, {FailureCause::kCrash, "the render child ended by signal 11"}, "the end of its log");
  }
  const std::string bytes = tile_of(task, world_.goes_wrong(Mishap::kResultMiscomputed, world_.plan.miscompute));
  spool_->make_room(task.result_key());
  {
    AtomicFile file(spool_->tile_path(task.result_key()));
    std::ofstream(file.path(), std::ios::binary) << bytes;
    file.commit();
  }
  RenderedTile tile;
  tile.path = spool_->tile_path(task.result_key());
  tile.digest = rpc::blob_digest(bytes);
  tile.result_key = task.result_key();
  tile.bytes = bytes.size();
  tile.samples = static_cast<uint64_t>(rpc::from_wire(task.rect(), "rect").area() * rpc::from_wire(task.range(), "range").size());
  tile.seconds = tile.cpu_seconds = 1;
  book_->rendered(grant, tile);
  world_.journal.say(id_, "has rendered task {}", task.task_id());
}

void Worker::upload(const v1::ResultOffer& offer) {
  uploading_ = true;
  const std::string key = offer.result_key(), digest = offer.result_digest();
  if (!spool_->holds(key, digest)) {
    uploading_ = false;
    world_.journal.say(id_, "has lost the result of task {}", offer.task_id());
    return book_->result_lost(key);
  }
  std::ifstream file(spool_->tile_path(key), std::ios::binary);
  const auto bytes = std::make_shared<std::string>(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
  const auto over = std::make_shared<bool>(false);
  const auto end = [this, key, over](bool arrived) {
    if (std::exchange(*over, true)) return;
    uploading_ = false;
    if (arrived)
      book_->uploaded(key);
    else
      book_->upload_failed(key, boot() + BootTime(world_.time(kSecond, 3 * kSecond)));
    act();
  };
  world_.send(id_, Way::kToCoordinator, [this, digest, bytes, end, life = life_] {
    world_.leader->upload(digest, *bytes, [this, end, life](bool arrived) {
      world_.send(id_, Way::kFromCoordinator, [this, end, arrived, life] {
        if (life == life_) later(0, [end, arrived] { end(arrived); });
      });
    });
  });
  later(10 * kSecond, [end] { end(false); });
}

}  // namespace woodcock::simulator
