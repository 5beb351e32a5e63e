// `woodcock workers`: who renders for a coordinator.
#include "client/workers.h"

#include <fmt/format.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/print.h"
#include "client/worker_times.h"
#include "rpc/quantities.h"

namespace woodcock {
namespace {

std::string condition_name(v1::WorkerCondition condition) {
  switch (condition) {
    case v1::WORKER_CONDITION_READY:
      return "ready";
    case v1::WORKER_CONDITION_DRAINING:
      return "draining";
    case v1::WORKER_CONDITION_QUARANTINED:
      return "quarantined";
    case v1::WORKER_CONDITION_LEFT:
      return "left";
    default:
      return "unknown";
  }
}

std::string list(const google::protobuf::RepeatedPtrField<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ",") + name;
  return text.empty() ? "-" : text;
}

nlohmann::json worker_json(const v1::WorkerStatus& worker) {
  return {{"worker_id", worker.worker_id()},
          {"host_name", worker.host_name()},
          {"slots", worker.slots()},
          {"threads", worker.threads()},
          {"condition", condition_name(worker.condition())},
          {"build", worker.build()},
          {"arithmetic_class", worker.arithmetic_class()},
          {"leases", worker.leases()},
          {"tags", std::vector<std::string>(worker.tags().begin(), worker.tags().end())},
          {"memory_bytes", worker.memory_bytes()},
          {"silent_seconds", static_cast<double>(worker.silent_ms()) * 1e-3}};
}

void print_workers(const std::vector<v1::WorkerStatus>& workers, const std::string& address) {
  if (workers.empty()) {
    say("no worker is connected to {}: start one with `woodcock-worker --dir DIR --coordinator {}`\n", address, address);
    return;
  }
  say("{:<26} {:<20} {:>5} {:>7} {:>9} {:<11} {:>6} {:>7}  {:<24}  {:<12}  {}\n", "WORKER", "HOST", "SLOTS", "THREADS", "MEMORY", "STATE",
      "LEASES", "HEARD", "BUILD", "CLASS", "TAGS");
  int64_t threads = 0, connected = 0;
  for (const v1::WorkerStatus& worker : workers) {
    say("{:<26} {:<20} {:>5} {:>7} {:>9} {:<11} {:>6} {:>5} s  {:<24.24}  {:<12.12}  {}\n", worker.worker_id(), worker.host_name(),
        worker.slots(), worker.threads(), worker.memory_bytes() > 0 ? rpc::bytes_text(worker.memory_bytes()) : "-",
        condition_name(worker.condition()), worker.leases(), worker.silent_ms() / 1000, worker.build(), worker.arithmetic_class(),
        list(worker.tags()));
    connected += worker.condition() != v1::WORKER_CONDITION_LEFT;
    if (worker.condition() == v1::WORKER_CONDITION_READY) threads += render_threads(worker);
  }
  say("{} worker{} connected; those that are ready render on {} threads (slots × threads)\n", connected, connected == 1 ? "" : "s",
      threads);
}

}  // namespace

std::vector<v1::WorkerStatus> list_workers(Service& service) {
  return service.list(&v1::JobsService::Stub::ListWorkers, v1::ListWorkersRequest(), &v1::ListWorkersResponse::workers,
                      "listing the workers");
}

void add_workers_command(CLI::App& app, int& code) {
  struct Options {
    ServiceOptions service;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("workers", "List the coordinator's connected workers");
  add_service_options(*command, options->service);
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Example:\n  woodcock workers\n"
      "A worker that was not heard of for a minute is not listed, nor one that left a minute ago. Tasks of one frame go to workers of one "
      "build and one arithmetic class.");
  command->callback([options, &code] {
    Service service(options->service);
    const std::vector<v1::WorkerStatus> workers = list_workers(service);
    if (options->json) {
      nlohmann::json all = nlohmann::json::array();
      for (const v1::WorkerStatus& worker : workers) all.push_back(worker_json(worker));
      say_json(nlohmann::json{{"workers", all}});
    } else {
      print_workers(workers, service.address());
    }
    code = 0;
  });
}

}  // namespace woodcock
