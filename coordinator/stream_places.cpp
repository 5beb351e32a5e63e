#include "coordinator/stream_places.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "rpc/error.h"

namespace woodcock::coordinator {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

namespace {

constexpr milliseconds kTick{100};

double seconds(milliseconds time) { return 1e-3 * static_cast<double>(time.count()); }

}  // namespace

StreamPlaces::StreamPlaces(std::string what, const StreamPlacesOptions& options) : what_(std::move(what)), options_(options) {
  thread_ = std::thread([this] { run(); });
}

StreamPlaces::~StreamPlaces() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void StreamPlaces::run() {
  std::unique_lock lock(mutex_);
  while (!stopping_) {
    changed_.wait_for(lock, std::min(kTick, options_.limit / 10));
    const auto now = Clock::now();
    for (Place* place : streams_)
      if (!place->working_ && now - place->moved_at_ >= options_.limit)
        end(*place, fmt::format("nothing moved for {:.3g} s; ask QueryUpload where to go on", seconds(options_.limit)));
  }
}

bool StreamPlaces::is_slow(const Place& place, Clock::time_point now) const {
  return !place.working_ && now - place.paced_at_ >= options_.patience;
}

void StreamPlaces::end(Place& place, const std::string& why) {
  if (!place.ended_.empty()) return;
  spdlog::info("one of {} {} is ended: {}", streams_.size(), what_, why);
  place.ended_ = why;
  place.cancel_();
}

StreamPlaces::Place::Place(StreamPlaces& places, std::function<void()> cancel) : places_(places), cancel_(std::move(cancel)) {
  const StreamPlacesOptions& options = places.options_;
  std::unique_lock lock(places.mutex_);
  const auto is_free = [&] { return static_cast<int>(places.streams_.size()) < options.places; };
  const auto deadline = Clock::now() + options.longest_wait;
  if (!is_free()) {
    if (places.waiting_ >= options.waiting) rpc::fail_exhausted("too many " + places.what_ + " at once; try again later");
    ++places.waiting_;
    // Those who were told to go count until they have gone.
    while (!is_free() && !places.stopping_ && Clock::now() < deadline) {
      const auto leaving = std::count_if(places.streams_.begin(), places.streams_.end(), [](const Place* p) { return !p->ended_.empty(); });
      Place* slowest = nullptr;
      for (Place* place : places.streams_)
        if (place->ended_.empty() && places.is_slow(*place, Clock::now()) && (!slowest || place->paced_at_ < slowest->paced_at_))
          slowest = place;
      if (slowest && leaving < places.waiting_) {
        places.end(*slowest, fmt::format("less than {} KiB moved for {:.3g} s while others waited; ask QueryUpload where to go on",
                                         options.least_bytes >> 10, seconds(options.patience)));
        continue;
      }
      places.changed_.wait_for(lock, kTick);
    }
    --places.waiting_;
    if (!is_free())
      rpc::fail_exhausted(fmt::format("{} {} are under way, and all of them move; try again later", options.places, places.what_));
  }
  moved_at_ = paced_at_ = Clock::now();
  places.streams_.insert(this);
}

StreamPlaces::Place::~Place() {
  {
    const std::lock_guard lock(places_.mutex_);
    places_.streams_.erase(this);
  }
  places_.changed_.notify_all();
}

void StreamPlaces::Place::moved(int64_t bytes) {
  const std::lock_guard lock(places_.mutex_);
  const auto now = Clock::now();
  // What this process took is not the peer's slowness.
  if (std::exchange(working_, false)) paced_at_ += now - work_began_;
  moved_at_ = now;
  bytes_ += bytes;
  if (bytes_ < places_.options_.least_bytes) return;
  paced_at_ = now;
  bytes_ = 0;
}

void StreamPlaces::Place::works() {
  const std::lock_guard lock(places_.mutex_);
  if (!std::exchange(working_, true)) work_began_ = Clock::now();
}

void StreamPlaces::Place::holds(const std::string& digest) {
  const std::lock_guard lock(places_.mutex_);
  digest_ = digest;
}

std::string StreamPlaces::Place::ended() const {
  const std::lock_guard lock(places_.mutex_);
  return ended_;
}

bool StreamPlaces::make_way(const std::string& digest) {
  std::unique_lock lock(mutex_);
  std::optional<Clock::time_point> seen;
  for (const auto deadline = Clock::now() + options_.longest_wait; !stopping_ && Clock::now() < deadline;) {
    const auto holder = std::find_if(streams_.begin(), streams_.end(), [&](const Place* place) { return place->digest_ == digest; });
    if (holder == streams_.end()) return true;
    Place& place = **holder;
    if (place.working_ || seen.value_or(place.paced_at_) != place.paced_at_) return false;
    seen = place.paced_at_;
    if (is_slow(place, Clock::now()))
      end(place, fmt::format("less than {} KiB moved for {:.3g} s while another sent the same file; ask QueryUpload where to go on",
                             options_.least_bytes >> 10, seconds(options_.patience)));
    changed_.wait_for(lock, kTick);
  }
  return false;
}

}  // namespace woodcock::coordinator
