// Where a crash of the coordinator is interesting. It names each point that it passes; tests kill it there.
#pragma once

#include <array>
#include <functional>
#include <string>

namespace woodcock::coordinator {

/// Told each point by name, on the thread that passes it.
using Failpoint = std::function<void(const char* point)>;

inline constexpr std::array<const char*, 16> kFailpoints{
    "upload-synced",           // an uploaded blob is on disk under its temporary name
    "upload-renamed",          // it has its name, the folder is not synced
    "in-commit",               // a result's rows are written, their transaction is open
    "after-commit",            // the transaction is durable, nobody knows
    "before-merge",            // all tasks of a frame are settled
    "during-merge",            // the child that merges was started
    "after-merge",             // the image is in a temporary file
    "image-synced",            // and on disk
    "image-renamed",           // and a blob, the folder is not synced
    "after-publish",           // the blob is durable, the frame's row is not
    "after-frame-row",         // the frame's row is durable, nobody knows
    "job-taken-out",           // a job's own row went, all that belongs to it is still there
    "job-rows-deleted",        // some or all of its other rows went
    "marked",                  // a clean-up knows what is referred to, and has removed nothing
    "backup-database-copied",  // a back-up has a copy of the database beside it
    "backup-blobs-taken",      // it has all blobs, and not its name
};

/// For tests: kills this process, as by SIGKILL, the N-th time it passes a point: "POINT@N", N from 1.
/// Throws std::invalid_argument, with a sentence, when `text` is nothing of the kind.
Failpoint kill_at(const std::string& text);

}  // namespace woodcock::coordinator
