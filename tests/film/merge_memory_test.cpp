// A program of its own: the peak of resident memory is a number of the whole process.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "renderer/film/merge.h"
#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

TEST(MergeMemory, AFrameOf4096SquaredStaysUnder600MiB) {
  testing::TemporaryFolder folder;
  constexpr int kSide = 4096, kTile = 64;
  const auto header = std::make_shared<const FrameHeader>(testing::some_header(kSide, kSide));
  // A few rendered tiles stand for all: memory does not depend on the values, the work of compression nearly not.
  std::vector<MergeInput> inputs;
  std::vector<Tile> samples;
  for (const SampleRange range : {SampleRange{0, 2}, SampleRange{2, 4}, SampleRange{4, 5}}) {
    samples.push_back(testing::render_tile({0, 0, kTile, kTile}, range));
    for (int y = 0; y < kSide; y += kTile)
      for (int x = 0; x < kSide; x += kTile) inputs.push_back({"tile", header, {x, y, x + kTile, y + kTile}, range});
  }
  const auto load = [&](size_t i) {
    for (const Tile& sample : samples)
      if (sample.range == inputs[i].range) return Tile{inputs[i].rect, sample.range, sample.pixels};
    return Tile{};
  };
  const NodeFileInfo info = merge_tiles(inputs, load, folder / "frame.exr");
  EXPECT_TRUE(info.gaps.empty());
  rusage usage;
  ASSERT_EQ(getrusage(RUSAGE_SELF, &usage), 0);
  RecordProperty("peak_rss_mib", static_cast<int>(usage.ru_maxrss / 1024));
  std::printf("peak resident memory: %ld MiB; file: %ld MiB\n", usage.ru_maxrss / 1024,
              static_cast<long>(std::filesystem::file_size(folder / "frame.exr") >> 20));
  EXPECT_LT(usage.ru_maxrss, 600 * 1024);
}

}  // namespace
}  // namespace woodcock
