#include "coordinator/policy.h"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "rpc/convert.h"
#include "rpc/error.h"
#include "rpc/limits.h"
#include "rpc/printable.h"

namespace woodcock::coordinator {
namespace {

std::vector<std::string> sorted_once(std::vector<std::string> names) {
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

void check_identifiers(const std::vector<std::string>& names, int limit, const std::string& field) {
  if (names.size() > static_cast<size_t>(limit))
    rpc::fail_invalid(field + ": found " + std::to_string(names.size()) + ", expected at most " + std::to_string(limit));
  for (const std::string& name : names)
    if (!rpc::is_identifier(name))
      rpc::fail_invalid(field + ": found \"" + rpc::printable(name.substr(0, 80)) +
                        "\", expected 1 to 64 characters of [A-Za-z0-9._-], not beginning with '.'");
}

}  // namespace

std::vector<std::string> checked_tags(std::vector<std::string> tags, const std::string& field) {
  check_identifiers(tags, rpc::kMaxTags, field);
  return sorted_once(std::move(tags));
}

JobPolicy checked_policy(const v1::JobPolicy& wire) {
  JobPolicy policy;
  if (wire.user().size() > rpc::kMaxIdBytes || !rpc::is_plain_text(wire.user()))
    rpc::fail_invalid("policy.user: expected at most 64 bytes without control characters");
  policy.user = wire.user();
  policy.demands.tags = checked_tags({wire.required_tags().begin(), wire.required_tags().end()}, "policy.required_tags");
  if (wire.memory_bytes() < 0 || wire.memory_bytes() > rpc::kMaxTaskMemory)
    rpc::fail_invalid("policy.memory_bytes: found " + std::to_string(wire.memory_bytes()) + ", expected 0 to 2^50");
  policy.demands.memory = wire.memory_bytes();
  if (wire.max_workers() > rpc::kMaxWorkersOfJob)
    rpc::fail_invalid("policy.max_workers: found " + std::to_string(wire.max_workers()) + ", expected 1 to 100000, or 0 for any number");
  policy.max_workers = wire.max_workers();
  policy.after.assign(wire.after().begin(), wire.after().end());
  check_identifiers(policy.after, rpc::kMaxJobsBefore, "policy.after");
  policy.after = sorted_once(std::move(policy.after));
  policy.waits_for = policy.after;
  return policy;
}

v1::JobPolicy to_wire(const JobPolicy& policy) {
  v1::JobPolicy wire;
  wire.set_user(policy.user);
  for (const std::string& tag : policy.demands.tags) wire.add_required_tags(tag);
  wire.set_memory_bytes(policy.demands.memory);
  wire.set_max_workers(static_cast<uint32_t>(policy.max_workers));
  for (const std::string& job : policy.after) wire.add_after(job);
  return wire;
}

std::string policy_text(const JobPolicy& policy) {
  if (policy == JobPolicy{}) return "";
  return nlohmann::json{
      {"user", policy.user},   {"tags", policy.demands.tags},  {"memory", policy.demands.memory}, {"max_workers", policy.max_workers},
      {"after", policy.after}, {"waits_for", policy.waits_for}}
      .dump();
}

JobPolicy parse_policy(const std::string& text) {
  if (text.empty()) return {};
  try {
    const nlohmann::json json = nlohmann::json::parse(text);
    JobPolicy policy;
    policy.user = json.at("user").get<std::string>();
    policy.demands = {json.at("tags").get<std::vector<std::string>>(), json.at("memory").get<int64_t>()};
    policy.max_workers = json.at("max_workers").get<size_t>();
    policy.after = json.at("after").get<std::vector<std::string>>();
    policy.waits_for = json.at("waits_for").get<std::vector<std::string>>();
    return policy;
  } catch (const nlohmann::json::exception& error) {
    throw std::runtime_error(std::string("malformed policy in the database: ") + error.what());
  }
}

}  // namespace woodcock::coordinator
