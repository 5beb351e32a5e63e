// The options that say who a job is for, which workers may render it, how many at once, and after what.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "woodcock/v1/job.pb.h"

namespace woodcock {

/// Adds --priority, --user, --require-tag, --memory, --max-workers and --after. `priority` and `policy` must outlive the parsing; a policy
/// without --user is the login name's.
void add_policy_options(CLI::App& command, int& priority, v1::JobPolicy& policy);

/// The login name of who runs this program, or "uid-1000" where that is none a job may have.
std::string login_name();

/// What a job asks for, a line each, for people: "needs     the tag big; 8 GiB of memory for a task". Empty where it asks for nothing.
std::vector<std::string> policy_lines(const v1::Job& job);
nlohmann::json policy_json(const v1::JobPolicy& policy);

}  // namespace woodcock
