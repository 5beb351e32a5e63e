#include "tests/service/simulator/simulation.h"

#include <fmt/format.h>
#include <malloc.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <iterator>
#include <memory>
#include <numeric>
#include <utility>

#include "rpc/manifest.h"
#include "tests/service/simulator/checks.h"
#include "tests/service/simulator/client.h"
#include "tests/service/simulator/leader.h"
#include "tests/service/simulator/worker.h"
#include "tests/service/simulator/world.h"

namespace woodcock::simulator {

World::World(uint64_t seed, Profile profile, const std::filesystem::path& folder_, std::ostream* log)
    : random(seed), journal(loop, log), plan(make_plan(profile, random)), folder(folder_), disk(folder_) {}
World::~World() = default;

void World::violate(const std::string& what) {
  journal.say("violation", "{}", what);
  if (!violation) violation = what;
}

void World::send(const std::string& peer, Way way, std::function<void()> deliver) {
  if (const auto link = cut.find(peer); link != cut.end() && link->second.contains(way)) return;
  if (goes_wrong(Mishap::kMessageLost, plan.lose)) return;
  const int copies = goes_wrong(Mishap::kMessageRepeated, plan.duplicate) ? 2 : 1;
  for (int i = 0; i < copies; ++i)
    loop.after(goes_wrong(Mishap::kMessageLate, plan.slow) ? time(100 * kMillisecond, 5 * kSecond) : time(100'000, 20 * kMillisecond),
               deliver);
}

namespace {

/// The longest that everything may take to end once nothing goes wrong any more.
constexpr Time kPatience = 1500 * kSecond;

/// Copies of a database are larger than what malloc keeps: without this each one is memory that the kernel maps and clears anew.
void keep_memory() {
  static const bool once = ::mallopt(M_MMAP_THRESHOLD, 16 << 20) == 1 && ::mallopt(M_TRIM_THRESHOLD, 64 << 20) == 1;
  static_cast<void>(once);
}

/// A scene that is there from the start, so that no schedule spends its time on its upload.
std::string add_scene(DiskImage& disk) {
  v1::SceneManifest manifest;
  v1::SceneFile* file = manifest.add_files();
  file->set_path("scene.pbrt");
  file->set_content_digest(rpc::blob_digest("scene"));
  file->set_bytes(5);
  const std::string list = rpc::serialize_manifest(manifest);
  for (const std::string& bytes : {std::string("scene"), list}) {
    const std::string digest = rpc::blob_digest(bytes);
    disk.folders.insert({"blobs", "blobs/" + digest.substr(0, 2)});
    disk.files["blobs/" + digest.substr(0, 2) + "/" + digest] = bytes;
  }
  return rpc::blob_digest(list);
}

/// An empty database, made once: few schedules spend their time on that.
const DiskImage& empty_database(World& world) {
  static const DiskImage image = [&] {
    const std::filesystem::path folder = world.folder / "first";
    std::filesystem::create_directories(folder);
    coordinator::StoreOptions options;
    options.dir = folder;
    options.on_fatal = [&](const std::string& reason) { world.violate(reason); };
    options.make_id = [] { return std::string("cluster"); };
    options.own_thread = false;
    { const coordinator::Store store(options); }
    DiskImage made = world.disk.after_kill(folder);
    world.disk.remove(folder);
    return made;
  }();
  return image;
}

class Faults {
 public:
  explicit Faults(World& world) : world_(world) { next(); }

 private:
  void next() {
    world_.loop.after(world_.time(world_.plan.pause / 4, 2 * world_.plan.pause), [this] {
      if (world_.calm) return;
      happen();
      next();
    });
  }

  Worker& some_worker() { return *world_.workers[static_cast<size_t>(world_.random.below(static_cast<int64_t>(world_.workers.size())))]; }

  void happen() {
    const int total = std::accumulate(world_.plan.weight.begin(), world_.plan.weight.end(), 0);
    if (total == 0) return;
    int64_t chosen = world_.random.below(total);
    size_t kind = 0;
    while (chosen >= world_.plan.weight[kind]) chosen -= world_.plan.weight[kind++];
    Worker& worker = some_worker();
    const auto fault = static_cast<Fault>(kind);
    const Time span = world_.random.chance(0.3) ? world_.time(8 * kSecond, 20 * kSecond) : world_.time(kSecond, 6 * kSecond);
    switch (fault) {
      case Fault::kKillCoordinator:
      case Fault::kCutCoordinatorsPower:
        if (world_.leader->up()) world_.injected.count(fault);
        return world_.leader->crash(fault == Fault::kCutCoordinatorsPower);
      case Fault::kKillCoordinatorAt:
        return world_.leader->crash_at(static_cast<int>(world_.random.between(1, 30)), false);
      case Fault::kCutCoordinatorsPowerAt:
        return world_.leader->crash_at(static_cast<int>(world_.random.between(1, 30)), true);
      case Fault::kStopCoordinator:
        return world_.leader->stop();
      case Fault::kReplaceLeader:
        return world_.leader->replace();
      case Fault::kKillWorker:
      case Fault::kCutWorkersPower:
        if (worker.running()) world_.injected.count(fault);
        return worker.crash(fault == Fault::kCutWorkersPower);
      case Fault::kFreezeWorker:
        worker.freeze();
        // Meanwhile somebody may speak for it.
        world_.loop.after(span, [&worker] { worker.go_on(); });
        return;
      case Fault::kDrainWorker:
        return worker.drain();
      case Fault::kCutLink: {
        const std::string peer = world_.random.chance(0.2) ? "client" : worker.id();
        std::set<Way>& ways = world_.cut[peer];
        if (world_.random.chance(0.7)) ways.insert(Way::kToCoordinator);
        if (ways.empty() || world_.random.chance(0.7)) ways.insert(Way::kFromCoordinator);
        world_.injected.count(fault);
        world_.journal.say("network", "is cut for {}, {} ways", peer, ways.size());
        world_.loop.after(span, [this, peer] { world_.cut.erase(peer); });
        return;
      }
      case Fault::kStaleReports:
        return worker.forge();
      case Fault::kDamageStoredByte: {
        const auto& all = world_.checks->acknowledged();
        if (all.empty() || world_.damaged.size() >= 3) return;
        const auto result = std::next(all.begin(), world_.random.below(static_cast<int64_t>(all.size())));
        if (!world_.leader->damage(result->second)) return;
        world_.damaged.insert(result->second);
        world_.injected.count(fault);
        world_.journal.say("coordinator", "has a damaged byte in the result {:.8} of task {}", result->second, result->first);
        return;
      }
    }
  }

  World& world_;
};

void run_until(World& world, Time end) {
  while (!world.violation && world.loop.now() < end && world.loop.step()) {
  }
}

/// Nothing goes wrong any more.
void calm_down(World& world) {
  world.journal.say("", "faults are over");
  world.calm = true;
  world.cut.clear();
  world.leader->crash_at(0, false);
  for (const auto& worker : world.workers) worker->go_on();
}

bool at_rest(World& world) {
  return world.client->satisfied() && world.leader->idle() &&
         std::all_of(world.workers.begin(), world.workers.end(), [](const auto& worker) { return worker->idle(); });
}

void play(World& world) {
  DiskImage disk;
  if (!world.random.chance(0.05)) disk = empty_database(world);
  const std::string manifest = add_scene(disk);
  world.checks = std::make_unique<Checks>(world);
  world.leader = std::make_unique<Leader>(world, std::move(disk));
  world.leader->start();
  for (int i = 1; i <= world.plan.workers; ++i)
    world.workers.push_back(
        std::make_unique<Worker>(world, i, world.plan.other_build && i == world.plan.workers ? "another build" : "build"));
  world.client = std::make_unique<Client>(world, manifest);
  Faults faults(world);
  run_until(world, world.loop.now() + world.plan.faulty);
  calm_down(world);
  const Time patience = world.loop.now() + kPatience;
  while (!world.violation && !at_rest(world) && world.loop.now() < patience) run_until(world, world.loop.now() + kSecond);
  if (world.violation) return;
  if (!at_rest(world)) {
    std::string stuck = "nothing goes wrong any more, and not everything ends: " + world.client->describe();
    for (const auto& worker : world.workers)
      if (!worker->idle()) stuck += fmt::format("{} is not idle; ", worker->id());
    if (!world.leader->idle()) stuck += "the coordinator has work";
    return world.violate(stuck);
  }
  // As it is now, and as it is after a restart.
  for (int i = 0; i < 2 && !world.violation; ++i) {
    world.leader->call({"check"}, [&](coordinator::Coordinator& c) {
      world.client->check_end(c);
      world.checks->finally(c);
    });
    if (i > 0) break;
    world.leader->crash(world.random.chance(0.5));
    run_until(world, world.loop.now() + 10 * kSecond);
  }
}

/// Sends what the production code logs to the journal.
class LogOf {
 public:
  explicit LogOf(std::ostream* log) : before_(spdlog::default_logger()) {
    auto logger = log ? std::make_shared<spdlog::logger>("simulator", std::make_shared<spdlog::sinks::ostream_sink_st>(*log))
                      : std::make_shared<spdlog::logger>("simulator");
    logger->set_level(log ? spdlog::level::info : spdlog::level::off);
    logger->set_pattern("                            | %v");
    spdlog::set_default_logger(logger);
  }
  ~LogOf() { spdlog::set_default_logger(before_); }
  LogOf(const LogOf&) = delete;
  LogOf& operator=(const LogOf&) = delete;

 private:
  std::shared_ptr<spdlog::logger> before_;
};

}  // namespace

void Outcome::add(const Outcome& other) {
  crashed_at.insert(other.crashed_at.begin(), other.crashed_at.end());
  acknowledged += other.acknowledged;
  restarts += other.restarts;
  power_cuts += other.power_cuts;
  outdated_leaders += other.outdated_leaders;
  failed_attempts += other.failed_attempts;
  damaged += other.damaged;
  for (size_t i = 0; i < kFaultKinds; ++i) injected.faults[i] += other.injected.faults[i];
  for (size_t i = 0; i < kMishapKinds; ++i) injected.mishaps[i] += other.injected.mishaps[i];
}

Outcome simulate(Profile profile, uint64_t seed, const std::filesystem::path& folder, std::ostream* log) {
  keep_memory();
  const LogOf log_of(log);
  Outcome outcome;
  {
    World world(seed, profile, folder, log);
    play(world);
    outcome.violation = world.violation;
    outcome.crashed_at = world.crashed_at;
    outcome.acknowledged = static_cast<int64_t>(world.checks->acknowledged().size());
    outcome.restarts = world.restarts;
    outcome.power_cuts = world.power_cuts;
    outcome.outdated_leaders = world.outdated_leaders;
    outcome.failed_attempts = world.failed_attempts;
    outcome.damaged = static_cast<int64_t>(world.damaged.size());
    outcome.injected = world.injected;
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder)) std::filesystem::remove_all(entry);
  return outcome;
}

std::string command_for(Profile profile, uint64_t seed) {
  return fmt::format("build/release/tests/simulator --profile {} --seed {}", kProfileNames[static_cast<size_t>(profile)], seed);
}

}  // namespace woodcock::simulator
