#include "client/event_list.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <ctime>

#include "client/print.h"

namespace woodcock {
namespace {

/// "JOB_EVENT_KIND_TASK_FAILED" → "task failed".
std::string kind_name(v1::JobEventKind kind) {
  std::string name = v1::JobEventKind_Name(kind);
  if (name.empty()) return "kind " + std::to_string(static_cast<int>(kind));
  name.erase(0, std::string("JOB_EVENT_KIND_").size());
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char c) { return c == '_' ? ' ' : static_cast<char>(std::tolower(c)); });
  return name;
}

nlohmann::json event_json(const v1::JobEvent& event) {
  nlohmann::json out{{"number", event.number()},   {"unix_ms", event.unix_ms()},     {"kind", kind_name(event.kind())},
                     {"task_id", event.task_id()}, {"worker_id", event.worker_id()}, {"message", event.message()}};
  if (event.has_frame()) out["frame"] = event.frame();
  return out;
}

void print_event(const v1::JobEvent& event) {
  say("{:>6}  {}  {:<18}", event.number(), utc_time(event.unix_ms()), kind_name(event.kind()));
  if (!event.task_id().empty())
    say("  task {}", event.task_id());
  else if (event.has_frame())
    say("  frame {}", event.frame());
  if (!event.worker_id().empty()) say("  worker {}", event.worker_id());
  if (!event.message().empty()) say("  {}", event.message());
  say("\n");
}

}  // namespace

std::string utc_time(int64_t unix_ms) {
  const auto seconds = static_cast<std::time_t>(unix_ms / 1000);
  std::tm time{};
  ::gmtime_r(&seconds, &time);
  return fmt::format("{:%Y-%m-%d %H:%M:%SZ}", time);
}

void print_events(Service& service, const std::string& job_id, int64_t after, bool json) {
  constexpr int kPage = 1000;
  v1::ListEventsRequest request;
  request.set_job_id(job_id);
  request.set_page_size(kPage);
  if (after > 0) request.set_page_token(std::to_string(after));
  // A job may have millions: none waits for the last.
  bool begun = false, first = true;
  do {
    v1::ListEventsResponse response;
    service.call(&v1::JobsService::Stub::ListEvents, request, response, "listing the events of job " + job_id);
    if (json && !begun) say("{}", Lines{"{\"job_id\": " + json_text(job_id, -1) + ", \"events\": ["});
    begun = true;
    for (const v1::JobEvent& event : response.events()) {
      if (json)
        say("{}", Lines{(first ? "\n" : ",\n") + json_text(event_json(event), -1)});
      else
        print_event(event);
      first = false;
    }
    request.set_page_token(response.next_page_token());
  } while (!request.page_token().empty());
  if (json) say("\n]}}\n");
}

}  // namespace woodcock
