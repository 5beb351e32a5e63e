#include "worker/supervisor.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "rpc/address.h"
#include "rpc/blob_transfer.h"
#include "rpc/channel.h"
#include "rpc/convert.h"
#include "rpc/failure.h"
#include "rpc/limits.h"
#include "rpc/status.h"

namespace woodcock {
namespace {

using std::chrono::milliseconds;
using Lock = std::unique_lock<std::mutex>;

/// A call that offers results is answered as soon as these are durable: it is not cut short for news before this, however far away the
/// coordinator is. Others are held until there is something to say, and are cut short as soon as they may have arrived.
constexpr milliseconds kOffering{1000}, kYoungCall{5};
/// Leases that end sooner are not worth more calls.
constexpr milliseconds kShortestRenewal{50};
constexpr milliseconds kTick{100};
constexpr milliseconds kFirstBackoff{200}, kLastBackoff{10'000};
/// After the drain's deadline, time to tell the coordinator about it; and for the last call, in which it is told that this worker leaves.
constexpr std::chrono::seconds kFarewell{5}, kLastCall{2};
/// That many refusals in a row as outdated mean a newer incarnation, not calls that overtook each other.
constexpr int kMaxAborts = 5;

milliseconds since(BootTime begin) { return std::chrono::duration_cast<milliseconds>(boot_now() - begin); }

}  // namespace

/// One Sync call. The request, the answer and the context live until the library is done with them.
struct Supervisor::Call {
  v1::SyncRequest request;
  v1::SyncResponse response;
  grpc::ClientContext context;
  grpc::Status status;
  std::unique_ptr<v1::WorkersService::Stub> stub;
  BootTime sent_at{0};
  uint64_t news = 0;                               // of the book when the request was made
  v1::WorkerState state = v1::WORKER_STATE_READY;  // what the request says
  bool cut = false;                                // ended by us
  bool done = false;
};

Supervisor::Supervisor(SupervisorOptions options, const WorkerFolder& folder)
    : options_(std::move(options)),
      folder_(folder),
      spool_(folder.spool()),
      store_(folder.assets(), options_.asset_cache_bytes),
      book_(spool_),
      addresses_(options_.coordinators) {
  if (book_.unacknowledged_results() > 0) spdlog::info("{} results of earlier are in the spool", book_.unacknowledged_results());
}

Supervisor::~Supervisor() = default;

int Supervisor::run() {
  std::vector<std::thread> threads;
  for (int slot = 0; slot < options_.slots; ++slot)
    threads.emplace_back([this, slot] { keep_running(fmt::format("slot {}", slot), [this, slot] { slot_loop(slot); }); });
  threads.emplace_back([this] { keep_running("the fetching of scenes", [this] { fetch_loop(); }); });
  threads.emplace_back([this] { keep_running("the upload of results", [this] { upload_loop(); }); });
  keep_running("the sync with the coordinator", [this] { sync_loop(); });
  for (std::thread& thread : threads) thread.join();
  const Lock lock(mutex_);
  return exit_code_;
}

void Supervisor::keep_running(const std::string& name, const std::function<void()>& loop) {
  while (true) {
    const auto error = rpc::failure_of(loop);
    Lock lock(mutex_);
    if (finished_) return;
    spdlog::error("{} failed and goes on: {}", name, error.value_or("it ended early"));
    pause(lock, std::chrono::seconds(1));
  }
}

void Supervisor::drain() {
  const Lock lock(mutex_);
  if (draining_) return;
  draining_ = true;
  drain_deadline_ = boot_now() + options_.drain;
  book_.drain();
  spdlog::info("draining: finishing what runs for at most {} s", std::chrono::duration_cast<std::chrono::seconds>(options_.drain).count());
  changed_.notify_all();
}

void Supervisor::quit() {
  const Lock lock(mutex_);
  end(0, "quitting at once; finished results stay in the spool");
}

void Supervisor::end(int exit_code, const std::string& why) {
  if (finished_) return;
  finished_ = true;
  exit_code_ = exit_code;
  if (exit_code == 0)
    spdlog::info("{}", why);
  else
    spdlog::error("{}", why);
  changed_.notify_all();
}

void Supervisor::pause(Lock& lock, milliseconds timeout) {
  changed_.wait_for(lock, timeout, [&] { return finished_; });
}

void Supervisor::note(const std::vector<std::string>& notes) const {
  for (const std::string& line : notes) spdlog::info("{}", line);
}

std::shared_ptr<grpc::Channel> Supervisor::channel() {
  const std::string& address = addresses_[address_ % addresses_.size()];
  std::shared_ptr<grpc::Channel>& known = channels_[address];
  if (!known) known = rpc::make_channel(address);
  return known;
}

// --- syncing -----------------------------------------------------------------------------------------------------

std::optional<milliseconds> Supervisor::renewal_interval() const {
  const auto shortest = book_.shortest_duration();
  if (!shortest) return std::nullopt;
  return std::max(*shortest / 3, kShortestRenewal);
}

void Supervisor::check_deadlines() {
  const BootTime now = boot_now();
  note(book_.expire(now));
  if (!draining_) return;
  if (now >= drain_deadline_) book_.stop_rendering();
  if (book_.idle())
    leave("drained");
  else if (now >= drain_deadline_ + kFarewell)
    leave(fmt::format("drained; {} results stay in the spool for the next start", book_.unacknowledged_results()));
}

v1::WorkerState Supervisor::state() const {
  return leaving_ ? v1::WORKER_STATE_LEFT : draining_ ? v1::WORKER_STATE_DRAINING : v1::WORKER_STATE_READY;
}

void Supervisor::leave(const std::string& why) {
  if (leaving_) return;
  leaving_ = why;
  if (!connected_ || !identity_) return end(0, why);
  changed_.notify_all();
}

v1::SyncRequest Supervisor::make_request() {
  v1::SyncRequest request;
  *request.mutable_protocol() = rpc::this_protocol();
  request.set_worker_id(options_.worker_id.empty() ? folder_.worker_id() : options_.worker_id);
  request.set_incarnation(folder_.incarnation());
  request.set_host_name(host_name());
  request.set_sequence(++sequence_);
  request.set_build(identity_->render_build);
  request.set_arithmetic_class(identity_->arithmetic_class);
  request.set_slots(static_cast<uint32_t>(options_.slots));
  request.set_threads(static_cast<uint32_t>(options_.threads));
  request.set_state(state());
  for (const std::string& tag : options_.tags) request.add_tags(tag);
  request.set_memory_bytes(options_.memory);
  if (draining_) request.set_drain_ms(std::max<int64_t>(0, std::chrono::duration_cast<milliseconds>(drain_deadline_ - boot_now()).count()));
  leader_.fill(request);
  book_.fill(request, boot_now());
  return request;
}

void Supervisor::sync_loop() {
  Lock lock(mutex_);
  while (!finished_ && !identity_) {
    changed_.wait_for(lock, kTick);
    check_deadlines();
  }
  while (!finished_) {
    Call call;
    call.request = make_request();
    call.news = book_.news();
    call.state = state();
    carry_out(call, lock);
    if (call.state == v1::WORKER_STATE_LEFT) end(0, *leaving_);
    if (finished_) break;
    milliseconds pause = take_answer(call);
    if (const auto renewal = renewal_interval(); renewal && call.status.ok()) pause = std::min(pause, *renewal);
    const BootTime until = boot_now() + pause;
    const bool answered = call.status.ok();
    while (!finished_ && boot_now() < until) {
      if (leaving_ || (answered && (book_.news() != call.news || state() != call.state))) break;
      changed_.wait_for(lock, std::clamp(-since(until), milliseconds(1), kTick));
      check_deadlines();
    }
  }
}

void Supervisor::carry_out(Call& call, Lock& lock) {
  call.stub = v1::WorkersService::NewStub(channel());
  call.sent_at = boot_now();
  if (call.state == v1::WORKER_STATE_LEFT)
    rpc::set_deadline(call.context, kLastCall);
  else
    rpc::set_deadline(call.context, rpc::kSyncDeadline);
  // The library may call back on this very thread: never hold the lock when calling it.
  lock.unlock();
  call.stub->async()->Sync(&call.context, &call.request, &call.response, [this, &call](grpc::Status status) {
    const Lock guard(mutex_);
    call.status = std::move(status);
    call.done = true;
    changed_.notify_all();
  });
  lock.lock();
  try {
    await(call, lock);
  } catch (...) {
    // The library writes into the call until it is done with it.
    if (!lock.owns_lock()) lock.lock();
    lock.unlock();
    call.context.TryCancel();
    lock.lock();
    changed_.wait(lock, [&] { return call.done; });
    throw;
  }
}

void Supervisor::await(Call& call, Lock& lock) {
  const auto renewal = renewal_interval();
  const milliseconds patience = call.request.offers().empty() ? kYoungCall : kOffering;
  const auto news = [&] { return call.state != v1::WORKER_STATE_LEFT && (book_.news() != call.news || state() != call.state); };
  while (!call.done) {
    const milliseconds age = since(call.sent_at);
    const bool cut_for_news = news() && age >= patience;
    if (!call.cut && (finished_ || cut_for_news || (renewal && age >= *renewal))) {
      call.cut = true;
      lock.unlock();
      call.context.TryCancel();
      lock.lock();
    }
    // Until it is done, until there is news, or until it is old enough to be cut short for what is known.
    const bool known = news();
    const milliseconds next = known && !call.cut && age < patience ? std::min(kTick, patience - age) : kTick;
    changed_.wait_for(lock, next, [&] { return call.done || (!call.cut && (finished_ || (!known && news()))); });
    if (!call.done) check_deadlines();
  }
}

milliseconds Supervisor::back_off() {
  milliseconds pause = std::min(kFirstBackoff * (int64_t{1} << std::min(failures_in_a_row_, 10)), kLastBackoff);
  ++failures_in_a_row_;
  return milliseconds(std::uniform_int_distribution<int64_t>(pause.count() / 2, pause.count())(random_));
}

bool Supervisor::recognize(const v1::SyncResponse& response) {
  const std::string& address = addresses_[address_ % addresses_.size()];
  const std::string cluster = leader_.cluster_id();
  switch (leader_.recognize(response)) {
    case LeaderSeen::Answer::kOtherCluster:
      spdlog::warn("the coordinator at {} is of another cluster, {} instead of {}: this worker joins it anew and drops its leases", address,
                   response.cluster_id(), cluster);
      book_.leave_cluster();
      break;
    case LeaderSeen::Answer::kOutdated:
      if (connected_)
        spdlog::warn("the coordinator at {} answers with leader term {}, and {} was seen: it is outdated; trying again", address,
                     response.leader_term(), leader_.leader_term());
      connected_ = false;
      ++address_;
      return false;
    case LeaderSeen::Answer::kRestarted:
      spdlog::info("the coordinator at {} was started again: leader term {}", address, response.leader_term());
      break;
    case LeaderSeen::Answer::kKnown:
      break;
  }
  return true;
}

milliseconds Supervisor::take_answer(const Call& call) {
  if (call.status.ok()) {
    if (!recognize(call.response)) return back_off();
    if (!connected_) {
      spdlog::info("connected to {}", addresses_[address_ % addresses_.size()]);
      folder_.mark_ready();
    }
    connected_ = true;
    failures_in_a_row_ = aborts_in_a_row_ = 0;
    // The answer to what was meant for another cluster says nothing else.
    if (!answers(call.response, call.request)) return milliseconds(0);
    note(book_.apply(call.request, call.sent_at, call.response, boot_now()));
    for (const std::string& address : call.response.coordinator_addresses())
      if (std::find(addresses_.begin(), addresses_.end(), address) == addresses_.end() && addresses_.size() < 16 &&
          rpc::problem_of_address(address).empty())
        addresses_.push_back(address);
    if (call.response.notice() != last_notice_) {
      last_notice_ = call.response.notice();
      if (!last_notice_.empty()) spdlog::info("the coordinator says: {}", last_notice_);
    }
    changed_.notify_all();
    return milliseconds(std::clamp<int64_t>(call.response.next_sync_ms(), 0, 10'000));
  }
  if (call.cut && call.status.error_code() == grpc::StatusCode::CANCELLED) return milliseconds(0);
  switch (call.status.error_code()) {
    case grpc::StatusCode::FAILED_PRECONDITION:
    case grpc::StatusCode::INVALID_ARGUMENT:
      end(1, "the coordinator refuses this worker: " + call.status.error_message());
      return milliseconds(0);
    case grpc::StatusCode::ABORTED:
      if (++aborts_in_a_row_ >= kMaxAborts) end(1, "another process uses this worker's identity: " + call.status.error_message());
      return back_off();
    default:
      // Once for each reason: a coordinator that is away, and then one that refuses by name, are two.
      if (connected_ || failures_in_a_row_ == 0 || std::exchange(last_problem_, call.status.error_message()) != call.status.error_message())
        spdlog::warn("no answer from the coordinator at {}: {} ({}); work goes on, trying again", addresses_[address_ % addresses_.size()],
                     call.status.error_message(), rpc::code_name(rpc::from_grpc(call.status.error_code())));
      connected_ = false;
      ++address_;
      return back_off();
  }
}

// --- fetching and uploading --------------------------------------------------------------------------------------

void Supervisor::fetch_loop() {
  Lock lock(mutex_);
  while (!finished_) {
    const auto grant = book_.next_to_fetch();
    if (!grant) {
      changed_.wait_for(lock, kTick);
      continue;
    }
    lock.unlock();
    const bool ready = fetch(*grant);
    lock.lock();
    if (ready) {
      book_.fetched(grant->lease_id());
      changed_.notify_all();
    }
  }
}

bool Supervisor::fetch(const v1::LeaseGrant& grant) {
  const auto fail = [&](const std::string& reason) {
    const Lock lock(mutex_);
    book_.failed(grant, {FailureCause::kTransfer, reason}, "");
    changed_.notify_all();
    return false;
  };
  const auto give_up = [&] {
    const Lock lock(mutex_);
    return finished_ || book_.should_stop(grant.lease_id(), boot_now());
  };
  rpc::TransferControl control;
  control.stop = give_up;
  control.progress = [&](int64_t) {
    const Lock lock(mutex_);
    book_.fetch_moved(grant.lease_id());
  };
  while (!give_up()) {
    std::shared_ptr<grpc::Channel> line;
    {
      const Lock lock(mutex_);
      line = channel();
    }
    const auto blobs = v1::BlobsService::NewStub(line);
    const BlobSource source{
        [&](const std::string& digest) { return rpc::download_bytes(*blobs, digest, rpc::kMaxManifestBytes); },
        [&](const std::string& digest, const std::string& path) { rpc::download_file(*blobs, digest, path, true, control); },
        [&] { control.progress(0); }};
    try {
      const Lock store_lock(store_mutex_);
      store_.prepare(grant.task().manifest_digest(), source);
      std::set<std::string> in_use;
      {
        const Lock lock(mutex_);
        in_use = book_.manifests_in_use();
      }
      store_.trim(in_use);
      return true;
    } catch (const rpc::RpcError& error) {
      if (error.code() == rpc::Code::kCancelled) continue;  // the loop's condition says why
      if (!rpc::is_retryable(error.code())) return fail(error.what());
      spdlog::warn("cannot fetch a scene: {}; trying again", error.what());
    } catch (const std::system_error& error) {
      return fail(fmt::format("the worker's disk: {}", error.what()));
    } catch (const std::exception& error) {
      return fail(error.what());
    }
    // Until the lease ends: it is not renewed while nothing arrives.
    Lock lock(mutex_);
    pause(lock, std::chrono::seconds(1));
  }
  const Lock lock(mutex_);
  book_.stopped(grant);
  return false;
}

void Supervisor::upload_loop() {
  Lock lock(mutex_);
  while (!finished_) {
    const auto offer = book_.next_to_upload(boot_now());
    if (!offer) {
      changed_.wait_for(lock, kTick);
      continue;
    }
    const auto line = channel();
    lock.unlock();
    std::string error;
    bool lost = false;
    try {
      lost = !spool_.holds(offer->result_key(), offer->result_digest());
      rpc::TransferControl control;
      control.stop = [this] {
        const Lock guard(mutex_);
        return finished_;
      };
      if (!lost) rpc::upload_file(*v1::BlobsService::NewStub(line), spool_.tile_path(offer->result_key()), offer->result_digest(), control);
    } catch (const std::exception& failure) {
      error = failure.what();
    }
    lock.lock();
    if (lost) {
      spdlog::error("the result of task {} is damaged on this disk: it is rendered again", offer->task_id());
      book_.result_lost(offer->result_key());
    } else if (error.empty()) {
      book_.uploaded(offer->result_key());
    } else if (!finished_) {
      spdlog::warn("cannot upload the result of task {}: {}; it stays in the spool", offer->task_id(), error);
      book_.upload_failed(offer->result_key(), boot_now() + milliseconds(std::uniform_int_distribution<int64_t>(1000, 3000)(random_)));
    }
    changed_.notify_all();
  }
}

}  // namespace woodcock
