// `woodcock doctor`: whether this machine has what Woodcock needs, and what to do where it has not.
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <ctime>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>
#include <vector>

#include "client/background_program.h"
#include "client/commands.h"
#include "client/print.h"
#include "client/run_program.h"
#include "client/service.h"
#include "renderer/frame/frame_renderer.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

struct DoctorOptions {
  ServiceOptions service;
  std::string folder = ".";
  bool json = false;
};

enum class Finding { kGood, kNote, kBad };
struct Check {
  std::string what;
  Finding finding = Finding::kGood;
  std::string found;
  std::string remedy;  ///< what to do; empty where nothing is to be done
};

Check check_processor() {
  const bool fits = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2") &&
                    __builtin_cpu_supports("fma") && __builtin_cpu_supports("lzcnt");
  const std::string found = fmt::format("{} processors, x86-64-v3 {}", std::thread::hardware_concurrency(), fits ? "yes" : "no");
  return {"processor", fits ? Finding::kGood : Finding::kBad, found, fits ? "" : "use a machine with AVX2, BMI2 and FMA (2013 and later)"};
}

Check check_arithmetic() {
  return {"arithmetic", Finding::kGood,
          fmt::format("class {}: machines of equal class and build render one frame together", arithmetic_class()), ""};
}

Check check_build() { return {"render build", Finding::kGood, render_build(), ""}; }

Check check_programs() {
  std::string missing;
  for (const char* name : {"woodcock-coordinator", "woodcock-worker"})
    if (::access((program_folder() / name).c_str(), X_OK) != 0) missing += (missing.empty() ? "" : ", ") + std::string(name);
  if (missing.empty()) return {"programs", Finding::kGood, "woodcock-coordinator and woodcock-worker in " + program_folder().string(), ""};
  return {"programs", Finding::kBad, missing + " missing in " + program_folder().string(), "build them: cmake --build build/release"};
}

Check check_memory() {
  const double gb = static_cast<double>(::sysconf(_SC_PHYS_PAGES)) * static_cast<double>(::sysconf(_SC_PAGESIZE)) / 1e9;
  return {"memory", gb < 2 ? Finding::kNote : Finding::kGood, fmt::format("{:.1f} GB", gb), gb < 2 ? "large scenes will not fit" : ""};
}

Check check_disk(const std::string& folder) {
  std::error_code error;
  const fs::space_info space = fs::space(folder, error);
  if (error) return {"disk", Finding::kBad, fmt::format("{}: {}", folder, error.message()), "name an existing folder with --dir"};
  const double gb = static_cast<double>(space.available) / 1e9;
  const bool writable = ::access(folder.c_str(), W_OK) == 0;
  const std::string found = fmt::format("{:.1f} GB free in {}{}", gb, fs::absolute(folder).string(), writable ? "" : ", not writable");
  if (!writable) return {"disk", Finding::kBad, found, "choose a folder that you may write to, with --dir"};
  if (gb < 1) return {"disk", Finding::kBad, found, "free some space: results and scenes need at least 1 GB"};
  return {"disk", Finding::kGood, found, ""};
}

/// Leases need a clock that goes on during suspend; people need dates.
Check check_clock() {
  timespec boot{};
  if (::clock_gettime(CLOCK_BOOTTIME, &boot) != 0) return {"clock", Finding::kBad, "no CLOCK_BOOTTIME", "use Linux 2.6.39 or later"};
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  ::gmtime_r(&now, &utc);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d %H:%M UTC", &utc);
  const bool plausible = utc.tm_year >= 124;
  return {"clock", plausible ? Finding::kGood : Finding::kNote, text.data(),
          plausible ? "" : "set the date: only people read it, leases do not depend on it"};
}

bool port_is_free(uint16_t port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const int on = 1;
  ::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  const bool is_free = ::bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  ::close(fd);
  return is_free;
}

/// One check for both: a port in use is right exactly if a coordinator is behind it.
Check check_coordinator(const ServiceOptions& options) {
  try {
    Service service(options);
    v1::ListJobsRequest request;
    request.set_page_size(1);
    v1::ListJobsResponse response;
    service.call(&v1::JobsService::Stub::ListJobs, request, response, "asking the coordinator", std::chrono::seconds(5));
    return {"coordinator", Finding::kGood, "answers at " + options.coordinator, ""};
  } catch (const rpc::RpcError& error) {
    if (options.coordinator != rpc::kDefaultAddress)
      return {"coordinator", Finding::kBad, error.what(), "check the address, the network and its log"};
    if (!port_is_free(7420))
      return {"coordinator", Finding::kBad, "port 7420 is used by another program",
              "find it with `ss -tlnp`, or run `woodcock up --port N`"};
    return {"coordinator", Finding::kNote, "none runs at " + options.coordinator + ", the port is free",
            "start one when you need it: woodcock up"};
  }
}

Check check_tools() {
  if (!find_program("bwrap").empty()) return {"sandbox", Finding::kGood, "bubblewrap is there", ""};
  return {"sandbox", Finding::kNote, "bubblewrap is not installed",
          "for scenes of strangers run workers as a user of their own, or in a container"};
}

Check check_plots() {
  if (!find_program("gnuplot").empty()) return {"plots", Finding::kGood, "gnuplot is there", ""};
  return {"plots", Finding::kNote, "gnuplot is not installed",
          "woodcock sweep then writes tables without plots; Debian: apt install gnuplot-nox"};
}

int run(const DoctorOptions& options) {
  const std::vector<Check> checks{
      check_processor(), check_memory(), check_clock(), check_disk(options.folder),        check_build(), check_arithmetic(),
      check_programs(),  check_tools(),  check_plots(), check_coordinator(options.service)};
  bool healthy = true;
  nlohmann::json report{{"checks", nlohmann::json::array()}};
  for (const Check& check : checks) {
    healthy = healthy && check.finding != Finding::kBad;
    const char* mark = check.finding == Finding::kGood ? "ok" : check.finding == Finding::kNote ? "note" : "WRONG";
    report["checks"].push_back({{"check", check.what}, {"finding", mark}, {"found", check.found}, {"remedy", check.remedy}});
    if (options.json) continue;
    say("{:<6} {:<13} {}\n", mark, check.what, check.found);
    if (!check.remedy.empty()) say("       {:<13} {}\n", "", check.remedy);
  }
  report["healthy"] = healthy;
  if (options.json) say_json(report);
  return healthy ? 0 : 1;
}

}  // namespace

void add_doctor_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("doctor", "Check this machine: processor, disk, clock, programs, coordinator");
  auto options = std::make_shared<DoctorOptions>();
  add_service_options(*command, options->service);
  command->add_option("--dir", options->folder, "Folder whose disk is checked")->capture_default_str();
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer("Example:\n  woodcock doctor\nExit code 1 when something is wrong; each such line says what to do.");
  command->callback([options, &code] { code = run(*options); });
}

}  // namespace woodcock
