// A folder in memory, where the system has one: nothing of a schedule needs a disk.
#pragma once

#include <filesystem>
#include <optional>

#include "tests/support/temporary_folder.h"

namespace woodcock::simulator {

class MemoryFolder {
 public:
  const std::filesystem::path& path() const { return folder_.path(); }

 private:
  static std::filesystem::path parent() {
    std::error_code error;
    const std::filesystem::path memory = "/dev/shm";
    return std::filesystem::is_directory(memory, error) ? memory : std::filesystem::temp_directory_path();
  }
  const testing::TemporaryFolder folder_{parent()};
};

}  // namespace woodcock::simulator
