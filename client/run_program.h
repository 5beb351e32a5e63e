// A program of this machine that is run and waited for.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace woodcock {

/// The file of that name in the folders of PATH that may be executed; empty where there is none.
std::filesystem::path find_program(const std::string& name);

/// Runs it with these arguments, as they are: no shell sees them. Its standard input is empty, what it says goes to `log`.
/// Returns the exit code, 128 + signal where one ended it. Throws std::runtime_error when it cannot be started.
int run_program(const std::filesystem::path& program, const std::vector<std::string>& arguments, const std::filesystem::path& log);

}  // namespace woodcock
