#include "tests/service/simulator/plan.h"

#include <algorithm>
#include <initializer_list>

namespace woodcock::simulator {
namespace {

void set(Plan& plan, std::initializer_list<Fault> faults, int weight) {
  for (const Fault fault : faults) plan.weight[static_cast<size_t>(fault)] = weight;
}

/// Each kind of fault is there in every other schedule: what many faults would hide a few show.
void take_some(Plan& plan, Random& random) {
  for (int& weight : plan.weight) weight = random.chance(0.5) ? static_cast<int>(random.between(1, 4)) : 0;
  const auto sometimes = [&](double value) { return random.chance(0.5) ? value : 0; };
  plan.lose = sometimes(0.08);
  plan.duplicate = sometimes(0.1);
  plan.slow = sometimes(0.1);
  plan.damage_upload = sometimes(0.15);
  plan.cut_upload = sometimes(0.15);
  plan.crash_task = sometimes(0.05);
  plan.lose_scene = sometimes(0.03);
  plan.miscompute = random.chance(0.2) ? 0.2 : 0;
  plan.poison = random.chance(0.15);
  plan.other_build = random.chance(0.15);
}

}  // namespace

std::optional<Profile> profile_named(const std::string& name) {
  const auto found = std::find(kProfileNames.begin(), kProfileNames.end(), name);
  if (found == kProfileNames.end()) return std::nullopt;
  return static_cast<Profile>(found - kProfileNames.begin());
}

Plan make_plan(Profile profile, Random& random) {
  Plan plan;
  plan.workers = static_cast<int>(random.between(2, 4));
  plan.jobs = static_cast<int>(random.between(1, 2));
  plan.faulty = random.between(10, 40) * kSecond;
  plan.pause = random.between(500, 4000) * kMillisecond;
  plan.adaptive = random.chance(0.2);
  plan.same_scene = random.chance(0.4);
  plan.store_batch = random.chance(0.5) ? 512 : static_cast<size_t>(random.between(1, 6));
  plan.store_delay = random.chance(0.2) ? 2 * kSecond : 20 * kMillisecond;
  switch (profile) {
    case Profile::kEverything:
      take_some(plan, random);
      break;
    case Profile::kStaleLeases:
      set(plan, {Fault::kStaleReports}, 6);
      set(plan, {Fault::kFreezeWorker}, 4);
      set(plan, {Fault::kCutLink, Fault::kDrainWorker, Fault::kKillCoordinator}, 1);
      break;
    case Profile::kPowerCuts:
      set(plan, {Fault::kCutCoordinatorsPower, Fault::kKillCoordinatorAt}, 1);
      set(plan, {Fault::kCutCoordinatorsPowerAt}, 4);
      break;
    case Profile::kPoison:
      plan.poison = true;
      plan.crash_task = 0.05;
      set(plan, {Fault::kKillWorker, Fault::kKillCoordinatorAt, Fault::kFreezeWorker}, 1);
      break;
    case Profile::kRepeatedMessages:
      plan.lose = 0.1;
      plan.duplicate = 0.3;
      plan.slow = 0.2;
      plan.cut_upload = 0.2;
      plan.straggle = 0.2;
      set(plan, {Fault::kCutLink, Fault::kKillWorker, Fault::kKillCoordinatorAt}, 1);
      break;
    case Profile::kDamagedBytes:
      plan.damage_upload = 0.3;
      plan.cut_upload = 0.2;
      plan.miscompute = 0.3;
      plan.straggle = 0.3;
      set(plan, {Fault::kDamageStoredByte, Fault::kCutWorkersPower, Fault::kFreezeWorker, Fault::kCutLink}, 1);
      break;
    case Profile::kRestarts:
      set(plan, {Fault::kKillCoordinator, Fault::kKillCoordinatorAt, Fault::kStopCoordinator}, 3);
      set(plan, {Fault::kCutLink, Fault::kFreezeWorker}, 1);
      break;
    case Profile::kOutdatedLeader:
      set(plan, {Fault::kReplaceLeader}, 6);
      set(plan, {Fault::kKillCoordinator, Fault::kCutLink, Fault::kFreezeWorker, Fault::kStaleReports}, 1);
      break;
  }
  return plan;
}

}  // namespace woodcock::simulator
