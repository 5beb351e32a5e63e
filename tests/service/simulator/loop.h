// Virtual time: what is to happen, in its order, on one thread.
#pragma once

#include <functional>
#include <map>
#include <utility>

#include "coordinator/model.h"

namespace woodcock::simulator {

using coordinator::kSecond;
using coordinator::Time;
inline constexpr Time kMillisecond = 1'000'000;

class Loop {
 public:
  Time now() const { return now_; }
  void after(Time delay, std::function<void()> work) { events_.emplace(now_ + delay, std::move(work)); }
  /// The next event. False where there is none.
  bool step() {
    if (events_.empty()) return false;
    auto next = events_.extract(events_.begin());
    now_ = next.key();
    next.mapped()();
    return true;
  }

 private:
  Time now_ = 1000 * kSecond;
  std::multimap<Time, std::function<void()>> events_;  // of one time in the order they were added
};

}  // namespace woodcock::simulator
