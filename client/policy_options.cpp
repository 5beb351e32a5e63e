#include "client/policy_options.h"

#include <fmt/format.h>
#include <pwd.h>
#include <unistd.h>

#include <stdexcept>

#include "rpc/convert.h"
#include "rpc/limits.h"
#include "rpc/printable.h"
#include "rpc/quantities.h"

namespace woodcock {
namespace {

std::string problem_of_identifier(const std::string& text) {
  return rpc::is_identifier(text) ? "" : "expected 1 to 64 letters, digits, '.', '_' or '-', no '.' first";
}

bool is_user(const std::string& name) {
  return !name.empty() && name.size() <= rpc::kMaxIdBytes && rpc::is_plain_text(name) && rpc::is_utf8(name);
}

/// One more name of a list that has at most `limit`.
template <typename Add>
auto adder(const char* option, int limit, Add add) {
  return [option, limit, add](const std::vector<std::string>& names) {
    if (names.size() > static_cast<size_t>(limit))
      throw CLI::ValidationError(option, fmt::format("found {}, expected at most {}", names.size(), limit));
    for (const std::string& name : names) add(name);
  };
}

std::string list(const google::protobuf::RepeatedPtrField<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

}  // namespace

std::string login_name() {
  std::string name;
  std::vector<char> buffer(16384);
  passwd entry{}, *found = nullptr;
  if (::getpwuid_r(::getuid(), &entry, buffer.data(), buffer.size(), &found) == 0 && found != nullptr) name = found->pw_name;
  return is_user(name) ? name : fmt::format("uid-{}", ::getuid());
}

void add_policy_options(CLI::App& command, int& priority, v1::JobPolicy& policy) {
  policy.set_user(login_name());
  command.add_option("--priority", priority, "Larger is served first; among equal ones the users share the workers")
      ->check(CLI::Range(-rpc::kMaxPriority, rpc::kMaxPriority))
      ->capture_default_str();
  command
      .add_option_function<std::string>(
          "--user", [&policy](const std::string& user) { policy.set_user(user); },
          "Whose share of the workers it takes (default: the login name)")
      ->type_name("NAME")
      ->check([](const std::string& user) {
        return is_user(user) ? std::string() : std::string("expected 1 to 64 bytes of text without control characters");
      });
  command
      .add_option_function<std::vector<std::string>>(
          "--require-tag", adder("--require-tag", rpc::kMaxTags, [&policy](const std::string& tag) { policy.add_required_tags(tag); }),
          "Only workers with this --tag render it; may be given again: with all of them")
      ->type_name("TAG")
      ->allow_extra_args(false)
      ->check(problem_of_identifier);
  command
      .add_option_function<std::string>(
          "--memory",
          [&policy](const std::string& text) {
            try {
              policy.set_memory_bytes(rpc::parse_bytes("--memory", text));
            } catch (const std::invalid_argument& error) {
              throw CLI::ValidationError(error.what());
            }
          },
          "Only workers that have so much memory for one task render it, e.g. 8G")
      ->type_name("SIZE");
  command
      .add_option_function<uint32_t>(
          "--max-workers", [&policy](uint32_t workers) { policy.set_max_workers(workers); }, "At most so many workers render it at once")
      ->type_name("N")
      ->check(CLI::Range(uint32_t{1}, rpc::kMaxWorkersOfJob));
  command
      .add_option_function<std::vector<std::string>>(
          "--after", adder("--after", rpc::kMaxJobsBefore, [&policy](const std::string& job) { policy.add_after(job); }),
          "Begin when this job is done; may be given again. Where one ends otherwise, this job fails")
      ->type_name("JOB")
      ->allow_extra_args(false)
      ->check(problem_of_identifier);
}

std::vector<std::string> policy_lines(const v1::Job& job) {
  const v1::JobPolicy& policy = job.policy();
  std::vector<std::string> lines;
  if (!policy.user().empty()) lines.push_back(fmt::format("user      {}, priority {}", policy.user(), job.priority()));
  std::string needs;
  const auto need = [&](const std::string& text) { needs += (needs.empty() ? "" : "; ") + text; };
  if (!policy.required_tags().empty()) need((policy.required_tags_size() > 1 ? "the tags " : "the tag ") + list(policy.required_tags()));
  if (policy.memory_bytes() > 0) need(rpc::bytes_text(policy.memory_bytes()) + " of memory for a task");
  if (policy.max_workers() > 0) need(fmt::format("at most {} worker{} at once", policy.max_workers(), policy.max_workers() > 1 ? "s" : ""));
  if (!needs.empty()) lines.push_back("needs     " + needs);
  if (!policy.after().empty()) lines.push_back("after     " + list(policy.after()));
  return lines;
}

nlohmann::json policy_json(const v1::JobPolicy& policy) {
  return {{"user", policy.user()},
          {"required_tags", std::vector<std::string>(policy.required_tags().begin(), policy.required_tags().end())},
          {"memory_bytes", policy.memory_bytes()},
          {"max_workers", policy.max_workers()},
          {"after", std::vector<std::string>(policy.after().begin(), policy.after().end())}};
}

}  // namespace woodcock
