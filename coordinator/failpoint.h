// Where a crash of the coordinator is interesting: at each step between write, fsync, rename, commit and reply. It names each point that
// it passes; tests kill it there.
#pragma once

#include <functional>
#include <span>
#include <string>

namespace woodcock::coordinator {

/// Told each point by name, on the thread that passes it.
using Failpoint = std::function<void(const char* point)>;

/// The names of all points. The build reads them from the sources (list_failpoints.cmake): each stands in a call of `failpoint`, with
/// a comment that says what is done there and what is not.
std::span<const char* const> failpoints();

/// For tests: kills this process, as by SIGKILL, the N-th time it passes a point: "POINT@N", N from 1.
/// Throws std::invalid_argument, with a sentence, when `text` is nothing of the kind.
Failpoint kill_at(const std::string& text);

}  // namespace woodcock::coordinator
