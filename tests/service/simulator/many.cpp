#include "tests/service/simulator/many.h"

#include <fmt/format.h>
#include <poll.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <new>
#include <set>
#include <stdexcept>
#include <utility>

namespace woodcock::simulator {
namespace {

using Clock = std::chrono::steady_clock;

constexpr size_t kMaxViolations = 10;
constexpr auto kBetweenReports = std::chrono::milliseconds(200);

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

Profile profile_of(const ManyOptions& options, uint64_t seed) { return options.profiles[seed % options.profiles.size()]; }

/// What a process has played since its last line.
struct Report {
  int64_t schedules = 0;
  std::vector<std::string> violations;
  Outcome sum;
};

std::string to_line(const Report& report) {
  const Outcome& sum = report.sum;
  return nlohmann::json{
             {"schedules", report.schedules},
             {"violations", report.violations},
             {"crashed_at", sum.crashed_at},
             {"counts", {sum.acknowledged, sum.restarts, sum.power_cuts, sum.outdated_leaders, sum.failed_attempts, sum.damaged}},
             {"faults", sum.injected.faults},
             {"mishaps", sum.injected.mishaps}}
             .dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) +
         '\n';
}

void take_line(const std::string& line, Many& many) {
  const nlohmann::json json = nlohmann::json::parse(line);
  many.schedules += json.at("schedules").get<int64_t>();
  for (const auto& violation : json.at("violations")) many.violations.push_back(violation.get<std::string>());
  Outcome sum;
  sum.crashed_at = json.at("crashed_at").get<std::set<std::string>>();
  const auto counts = json.at("counts").get<std::vector<int64_t>>();
  sum.acknowledged = counts.at(0);
  sum.restarts = counts.at(1);
  sum.power_cuts = counts.at(2);
  sum.outdated_leaders = counts.at(3);
  sum.failed_attempts = counts.at(4);
  sum.damaged = counts.at(5);
  sum.injected.faults = json.at("faults").get<decltype(sum.injected.faults)>();
  sum.injected.mishaps = json.at("mishaps").get<decltype(sum.injected.mishaps)>();
  many.sum.add(sum);
}

void send(int pipe, const std::string& line) {
  for (size_t done = 0; done < line.size();) {
    const ssize_t n = ::write(pipe, line.data() + done, line.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) ::_exit(1);  // nobody listens
    done += static_cast<size_t>(n);
  }
}

/// Each `processes`-th schedule, from the `part`-th on. `seed` says which one is under way.
void play_part(const ManyOptions& options, int part, const std::filesystem::path& folder, int pipe, std::atomic<uint64_t>& seed) {
  Report report;
  auto sent = Clock::now();
  for (int64_t i = part; i < options.schedules; i += options.processes) {
    seed = options.first + static_cast<uint64_t>(i);
    const Profile profile = profile_of(options, seed);
    const Outcome outcome = options.play(profile, seed, folder);
    ++report.schedules;
    report.sum.add(outcome);
    if (outcome.violation) report.violations.push_back(*outcome.violation + "\n  " + command_for(profile, seed));
    if (report.violations.empty() && Clock::now() - sent < kBetweenReports) continue;
    send(pipe, to_line(report));
    report = {};
    sent = Clock::now();
  }
  send(pipe, to_line(report));
}

/// The seed that each process plays, where all of them see it.
class Seeds {
 public:
  explicit Seeds(int processes) : bytes_(sizeof(std::atomic<uint64_t>) * static_cast<size_t>(processes)) {
    void* const memory = ::mmap(nullptr, bytes_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::runtime_error("no memory that processes share");
    seeds_ = static_cast<std::atomic<uint64_t>*>(memory);
    for (int i = 0; i < processes; ++i) new (seeds_ + i) std::atomic<uint64_t>(0);
  }
  ~Seeds() { ::munmap(seeds_, bytes_); }
  Seeds(const Seeds&) = delete;
  Seeds& operator=(const Seeds&) = delete;
  std::atomic<uint64_t>& operator[](int process) { return seeds_[process]; }

 private:
  size_t bytes_;
  std::atomic<uint64_t>* seeds_;
};

struct Player {
  pid_t process = -1;
  int pipe = -1;
  std::string unread;  ///< of a line that has not ended
};

Player start(const ManyOptions& options, int part, const std::filesystem::path& folder, std::atomic<uint64_t>& seed) {
  std::filesystem::create_directories(folder);
  int ends[2];
  if (::pipe(ends) != 0) throw std::runtime_error("no pipe to a process that plays schedules");
  const pid_t parent = ::getpid(), process = ::fork();
  if (process < 0) throw std::runtime_error("no process to play schedules");
  if (process == 0) {
    ::close(ends[0]);
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (::getppid() == parent) play_part(options, part, folder, ends[1], seed);
    ::_exit(0);
  }
  ::close(ends[1]);
  return {process, ends[0], ""};
}

/// Takes what has arrived. False at the end.
bool take_lines(Player& player, Many& many) {
  char buffer[1 << 14];
  const ssize_t n = ::read(player.pipe, buffer, sizeof buffer);
  if (n < 0 && errno == EINTR) return true;
  if (n <= 0) return false;
  player.unread.append(buffer, static_cast<size_t>(n));
  for (size_t end = player.unread.find('\n'); end != std::string::npos; end = player.unread.find('\n')) {
    take_line(player.unread.substr(0, end), many);
    player.unread.erase(0, end + 1);
  }
  return true;
}

std::string progress_of(const ManyOptions& options, const Many& many) {
  const double rate = static_cast<double>(many.schedules) / std::max(many.seconds, 1e-3);
  const auto left = static_cast<double>(options.schedules - many.schedules) / std::max(rate, 1e-3);
  return fmt::format("{} of {} schedules in {:.0f} s, {:.0f} a minute, {:.0f} s left: {} violations", many.schedules, options.schedules,
                     many.seconds, 60 * rate, left, many.violations.size());
}

}  // namespace

Many play_many(const ManyOptions& options, const std::filesystem::path& folder, std::ostream& progress) {
  const auto begin = Clock::now();
  Many many;
  Seeds seeds(options.processes);
  std::vector<Player> players;
  for (int i = 0; i < options.processes; ++i) players.push_back(start(options, i, folder / fmt::format("process-{}", i), seeds[i]));
  bool stopped = false;
  size_t running = players.size(), told = 0;
  for (double next = options.progress_seconds; running > 0;) {
    std::vector<pollfd> pipes;
    for (const Player& player : players) pipes.push_back({player.pipe, POLLIN, 0});  // a closed one is -1, and ignored
    ::poll(pipes.data(), pipes.size(), 1000);
    for (size_t i = 0; i < players.size(); ++i) {
      Player& player = players[i];
      if (player.pipe < 0 || pipes[i].revents == 0 || take_lines(player, many)) continue;
      ::close(std::exchange(player.pipe, -1));
      --running;
      int status = 0;
      ::waitpid(player.process, &status, 0);
      if (stopped || status == 0) continue;
      const uint64_t seed = seeds[static_cast<int>(i)];
      many.violations.push_back(fmt::format("the process that played it ended {} {}\n  {}", WIFSIGNALED(status) ? "by signal" : "with code",
                                            WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status),
                                            command_for(profile_of(options, seed), seed)));
    }
    for (; told < many.violations.size(); ++told) progress << many.violations[told] << std::endl;
    if (!stopped && many.violations.size() >= kMaxViolations) {
      stopped = true;
      for (const Player& player : players)
        if (player.pipe >= 0) ::kill(player.process, SIGKILL);
    }
    many.seconds = seconds_since(begin);
    if (many.seconds < next || running == 0) continue;
    next = many.seconds + options.progress_seconds;
    progress << progress_of(options, many) << std::endl;
  }
  return many;
}

std::string describe(const Many& many) {
  std::string text = fmt::format("{} schedules in {:.0f} s: {} violations; {} results acknowledged, {} starts of the coordinator",
                                 many.schedules, many.seconds, many.violations.size(), many.sum.acknowledged, many.sum.restarts);
  text += fmt::format("; ended at {} failpoints; faults:", many.sum.crashed_at.size());
  const char* separator = " ";
  const auto add = [&](int64_t count, const char* name) { text += fmt::format("{}{} {}", std::exchange(separator, ", "), count, name); };
  for (size_t i = 0; i < kFaultKinds; ++i) add(many.sum.injected.faults[i], kFaultNames[i]);
  for (size_t i = 0; i < kMishapKinds; ++i) add(many.sum.injected.mishaps[i], kMishapNames[i]);
  return text;
}

}  // namespace woodcock::simulator
