// One sample in the making: what all branches of its path read and add to.
#pragma once

#include "renderer/transport/render_plan.h"

namespace woodcock {

struct PathSample {
  const World& world;
  const RenderPlan& plan;
  PathCounters& count;
  PathResult result{};
  uint32_t branches = 0;  ///< begun so far; they number the keys
  uint64_t look_ups = 0;
  bool stopped = false;  ///< the render is to end: what the sample holds means nothing

  /// Long samples show that they live and can be stopped.
  void report() {
    plan.watch->vertices.fetch_add(kReportEvery, std::memory_order_relaxed);
    look_for_end();
  }

  /// The coefficients at a point: counted where they are looked up, and now and then a look at whether the render is to end.
  MediumPoint look_up(const Medium& medium, DVec3 p) {
    if ((++look_ups & (kReportEvery - 1)) == 0 && plan.watch != nullptr) look_for_end();
    if (medium.is_homogeneous()) return medium.homogeneous();
    ++count.medium_lookups;
    return medium.at(p);
  }

 private:
  void look_for_end() { stopped = stopped || plan.watch->cancel.load(std::memory_order_relaxed); }
};

}  // namespace woodcock
