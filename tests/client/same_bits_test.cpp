// The same bits from `woodcock render`, whatever the tiles, threads and sample split.
#include <gtest/gtest.h>

#include "tests/support/frame_bytes.h"
#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

namespace fs = std::filesystem;

const std::string kWoodcock = WOODCOCK_BIN_DIR "/woodcock";

class SameBits : public ::testing::TestWithParam<std::string> {
 protected:
  /// Renders a part of the scene small and returns the bytes of the picture and its nodes.
  std::string render(const std::string& name, const std::vector<std::string>& options) {
    std::vector<std::string> arguments{kWoodcock,
                                       "render",
                                       std::string(WOODCOCK_SOURCE_DIR "/scenes/") + GetParam() + ".pbrt",
                                       "-o",
                                       (folder_ / name).string(),
                                       "--resolution",
                                       "48x27",
                                       "--json"};
    arguments.insert(arguments.end(), options.begin(), options.end());
    const CommandResult result = run_command(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return bytes_of_frame(folder_ / name);
  }

  TemporaryFolder folder_;
};

TEST_P(SameBits, WhateverTheTileSize) {
  const std::string reference = render("reference.exr", {"--spp", "16"});
  ASSERT_FALSE(reference.empty());
  for (const char* tile : {"7", "16", "64"}) EXPECT_EQ(render("tile.exr", {"--spp", "16", "--tile", tile}), reference) << tile;
}

TEST_P(SameBits, WhateverTheNumberOfThreads) {
  EXPECT_EQ(render("one.exr", {"--spp", "8", "--threads", "1"}), render("two.exr", {"--spp", "8", "--threads", "2"}));
  EXPECT_EQ(render("five.exr", {"--spp", "8", "--threads", "5"}), bytes_of_frame(folder_ / "one.exr"));
}

TEST_P(SameBits, WhenSampleRangesAreMerged) {
  const std::string whole = render("whole.exr", {"--spp", "16"});
  render("a.exr", {"--samples", "0:5"});
  render("b.exr", {"--samples", "5:16"});
  for (const bool forward : {true, false}) {
    const auto merged = folder_ / "merged.exr";
    const CommandResult result = run_command({kWoodcock, "merge", (folder_ / (forward ? "a.exr" : "b.exr")).string(),
                                              (folder_ / (forward ? "b.exr" : "a.exr")).string(), "-o", merged.string()});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_EQ(bytes_of_frame(merged), whole);
  }
}

TEST_P(SameBits, WhenARenderIsResumed) {
  const std::string whole = render("whole.exr", {"--spp", "12"});
  render("resumed.exr", {"--spp", "3"});
  EXPECT_EQ(render("resumed.exr", {"--spp", "12", "--resume"}), whole);
}

TEST_P(SameBits, CropsThatAskForDifferentPixelsAreNotMerged) {
  render("left.exr", {"--spp", "4", "--crop", "0,17,0,27"});
  render("right.exr", {"--spp", "4", "--crop", "17,48,0,27"});
  const CommandResult result = run_command(
      {kWoodcock, "merge", (folder_ / "left.exr").string(), (folder_ / "right.exr").string(), "-o", (folder_ / "both.exr").string()});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("bounds"), std::string::npos) << result.err;
}

INSTANTIATE_TEST_SUITE_P(Scenes, SameBits, ::testing::Values("cloud", "effects"), [](const auto& scene) { return scene.param; });

}  // namespace
}  // namespace woodcock::testing
