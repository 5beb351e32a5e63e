// What the tests of faults share: a job long enough to meet a fault half way, and ways to make a file unreadable that hold for
// root too.
#pragma once

#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/service/service_fixture.h"

namespace woodcock::testing_service {

/// How a file cannot be read.
enum class Unreadable { kFolder, kDanglingLink, kLinkLoop, kIoError };
inline constexpr std::array kAllUnreadable{Unreadable::kFolder, Unreadable::kDanglingLink, Unreadable::kLinkLoop, Unreadable::kIoError};

/// Puts something that cannot be read in the place of `path`.
inline void make_unreadable(const std::filesystem::path& path, Unreadable how) {
  namespace fs = std::filesystem;
  fs::remove_all(path);
  switch (how) {
    case Unreadable::kFolder:
      fs::create_directory(path);
      std::ofstream(path / "inside") << "not empty";
      break;
    case Unreadable::kDanglingLink:
      fs::create_symlink(path.string() + ".nowhere", path);
      break;
    case Unreadable::kLinkLoop:
      fs::create_symlink(path.filename(), path);
      break;
    case Unreadable::kIoError:
      // A regular file that opens; reading its first byte gives EIO.
      fs::create_symlink("/proc/self/mem", path);
      break;
  }
}

class FarmFault : public ServiceTest {
 protected:
  const std::string cornell_ = std::string(WOODCOCK_SOURCE_DIR) + "/scenes/cornell.pbrt";
  /// A second or two of work in 9 × 4 tasks.
  const std::vector<std::string> scene_{cornell_, "--spp", "128", "--resolution", "48x48"};

  std::string start_job(std::vector<std::string> more = {"--tile", "16"}) {
    more.insert(more.end(), scene_.begin(), scene_.end());
    return submit(more);
  }
  void expect_undisturbed(const std::string& job) {
    ASSERT_EQ(watch(job), 0) << show(job).dump(2);
    ASSERT_EQ(woodcock({"fetch", job, "-o", path("image.exr")}).code, 0);
    EXPECT_TRUE(contents(path("image.exr")) == rendered(scene_));
  }
  void restart_workers() {
    const size_t count = workers_.size();
    workers_.clear();
    for (size_t i = 0; i < count; ++i) start_worker();
  }
  /// Waits until a program's log has the words.
  static bool says(Program& program, const std::string& words) {
    return eventually(kPatience, [&] { return program.err().find(words) != std::string::npos || !program.running(); }) &&
           program.err().find(words) != std::string::npos;
  }
  /// The coordinator's blobs that begin with these bytes.
  std::vector<std::filesystem::path> blobs_that_begin(const std::string& magic) const {
    std::vector<std::filesystem::path> found;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_ / "coordinator" / "blobs")) {
      if (!entry.is_regular_file() || entry.is_symlink()) continue;
      std::ifstream file(entry.path(), std::ios::binary);
      std::string begin(magic.size(), '\0');
      if (file.read(begin.data(), static_cast<std::streamsize>(begin.size())) && begin == magic) found.push_back(entry.path());
    }
    return found;
  }
  std::vector<std::filesystem::path> exr_blobs() const { return blobs_that_begin("\x76\x2f\x31\x01"); }
};

}  // namespace woodcock::testing_service
