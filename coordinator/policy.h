// Who a job is for, which workers may render it, how many at once, and after what.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "woodcock/v1/job_policy.pb.h"

namespace woodcock::coordinator {

/// What a worker must have to get a task of a job.
struct Demands {
  std::vector<std::string> tags;  ///< all of these; in order, each once
  int64_t memory = 0;             ///< bytes for one task; 0: any

  friend auto operator<=>(const Demands&, const Demands&) = default;
};

struct JobPolicy {
  std::string user;  ///< empty where none is told
  Demands demands;
  size_t max_workers = 0;              ///< that hold leases at once; 0: any number
  std::vector<std::string> after;      ///< jobs, as submitted; in order, each once
  std::vector<std::string> waits_for;  ///< those of them that are not done yet

  friend bool operator==(const JobPolicy&, const JobPolicy&) = default;
};

/// Tags as they are compared: in order, each once. Throws RpcError INVALID_ARGUMENT that names `field` for more than 32, or for one that
/// is no identifier.
std::vector<std::string> checked_tags(std::vector<std::string> tags, const std::string& field);

/// Checks every field; `waits_for` is all of `after`. Throws RpcError INVALID_ARGUMENT.
JobPolicy checked_policy(const v1::JobPolicy& wire);
v1::JobPolicy to_wire(const JobPolicy& policy);

/// For the database; empty for a job that asks for nothing and is nobody's.
std::string policy_text(const JobPolicy& policy);
/// Throws std::runtime_error on malformed text.
JobPolicy parse_policy(const std::string& text);

}  // namespace woodcock::coordinator
