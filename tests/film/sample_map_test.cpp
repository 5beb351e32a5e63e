// Frames whose blocks hold different numbers of samples.
#include "renderer/film/sample_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "renderer/film/merge.h"
#include "renderer/film/png.h"
#include "renderer/film/split.h"
#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

using testing::bytes_of;
using ::testing::HasSubstr;
using testing::message_of;
using testing::render_nodes;
using testing::render_tile;
using testing::some_header;

/// A frame whose bounds cut the blocks at its edges.
FrameHeader cropped_header() {
  FrameHeader header = some_header(140, 100);
  header.bounds = {5, 7, 130, 90};
  return header;
}

SampleMap random_map(PixelRect rect, std::span<const int64_t> counts, Stream& random) {
  SampleMap map{rect, {}};
  for (size_t i = 0; i < map.grid().size(); ++i) map.counts.push_back(counts[random.next_u32() % counts.size()]);
  return map;
}

struct Work {
  std::shared_ptr<const FrameHeader> header;
  std::vector<MergeInput> inputs;
  std::vector<Tile> tiles;

  void add(PixelRect rect, SampleRange range) {
    inputs.push_back({"tile " + std::to_string(inputs.size()), header, rect, range});
    tiles.push_back(render_tile(rect, range));
  }
  NodeFileInfo merge(const std::filesystem::path& out, const MergeTarget& target) const {
    return merge_tiles(
        inputs, [this](size_t i) { return tiles[i]; }, out, target);
  }
};

/// What the map asks for, in tiles of edge `tile` and ranges of at most `length` samples.
Work work_of(const FrameHeader& header, const SampleMap& map, int tile, int64_t length) {
  Work work{std::make_shared<const FrameHeader>(header), {}, {}};
  for (size_t b = 0; b < map.counts.size(); ++b)
    for (const SampleRange range : bounded_nodes({0, map.counts[b]}, length))
      for (const PixelRect rect : tile_grid(map.grid().block(b), tile)) work.add(rect, range);
  return work;
}

constexpr int64_t kCounts[] = {16, 20, 24, 28, 32, 40};

TEST(SampleMap, HasTheBlocksOfTheFullImage) {
  const BlockGrid grid{{40, 10, 100, 64}};
  EXPECT_EQ(grid.across(), 3);
  EXPECT_EQ(grid.down(), 2);
  EXPECT_EQ(grid.block(0), (PixelRect{40, 10, 64, 32}));
  EXPECT_EQ(grid.block(5), (PixelRect{96, 32, 100, 64}));
  for (int y = 10; y < 64; ++y)
    for (int x = 40; x < 100; ++x) ASSERT_TRUE(grid.block(grid.index(x, y)).contains({x, y, x + 1, y + 1}));
}

TEST(SampleMap, NodesAreThoseOfEachCount) {
  for (int64_t count = 0; count < 300; ++count) {
    const auto nodes = dyadic_nodes({0, count});
    for (int64_t size = 1; size <= 512; size *= 2)
      for (int64_t begin = 0; begin < 600; begin += size)
        ASSERT_EQ(holds_node(count, {begin, begin + size}),
                  std::find(nodes.begin(), nodes.end(), SampleRange{begin, begin + size}) != nodes.end());
  }
  const SampleMap map{{0, 0, 96, 32}, {16, 20, 0}};
  EXPECT_EQ(map_nodes(map), (std::vector<SampleRange>{{0, 16}, {16, 20}}));
}

TEST(SampleMap, TextOfCountsIsReadBackAndAnythingElseRefused) {
  const std::vector<int64_t> counts{16, 16, 16, 20, 0, 24, 24};
  EXPECT_EQ(to_text(counts), "16x3,20,0,24x2");
  EXPECT_EQ(parse_counts("16x3,20,0,24x2", 7), counts);
  for (const char* bad : {"", "16x3,20,0,24x2,", "16x3,20,0,24x3", "16x3,20,0,24", "16x0,20,0,24x2", "16x3,-20,0,24x2", "16x3,20,0,24x2 ",
                          "16x3;20,0,24x2", "16x99999999999999999999,1", "16777217x7", "7x7x1", "x7", ",7x6"})
    EXPECT_FALSE(parse_counts(bad, 7)) << bad;
  EXPECT_FALSE(parse_counts("1x1000000000", 7));
}

TEST(SampleMap, AnySplitMakesTheSameBytesAndEachPixelIsTheFoldOfItsOwnNodes) {
  testing::TemporaryFolder folder;
  const FrameHeader header = cropped_header();
  Stream random(3);
  const SampleMap map = random_map(header.bounds, kCounts, random);
  work_of(header, map, 32, 64).merge(folder / "a.exr", {{}, {}, map});
  work_of(header, map, 8, 4).merge(folder / "b.exr", {{}, {}, map});
  EXPECT_EQ(bytes_of(folder / "a.exr"), bytes_of(folder / "b.exr"));

  ExrReader reader(folder / "a.exr");
  ASSERT_TRUE(reader.info().map);
  EXPECT_EQ(*reader.info().map, map);
  EXPECT_EQ(reader.info().missing_pixels, 0);
  const auto picture = reader.beauty_rows(header.bounds.y0, header.bounds.y1);
  const auto pixel = [&](const std::vector<PixelStats>& rows, int x, int y) {
    return rows[static_cast<size_t>((y - header.bounds.y0) * header.bounds.width() + x - header.bounds.x0)];
  };
  for (size_t b = 0; b < map.counts.size(); ++b) {
    const PixelRect block = map.grid().block(b);
    const auto nodes = render_nodes(block, {0, map.counts[b]});
    std::vector<SampleRange> ranges;
    for (const Tile& node : nodes) ranges.push_back(node.range);
    for (int y = block.y0; y < block.y1; y += 3)
      for (int x = block.x0; x < block.x1; x += 5) {
        std::vector<PixelStats> own;
        for (const Tile& node : nodes) own.push_back(node.at(x, y));
        const PixelStats expected = fold(ranges, own), found = pixel(picture, x, y);
        ASSERT_EQ(std::memcmp(&expected, &found, sizeof found), 0) << x << ", " << y;
      }
  }
  for (size_t n = 0; n < reader.info().nodes.size(); ++n) {
    const auto rows = reader.node_rows(n, header.bounds.y0, header.bounds.y1);
    for (int y = header.bounds.y0; y < header.bounds.y1; y += 3)
      for (int x = header.bounds.x0; x < header.bounds.x1; x += 5)
        ASSERT_EQ(pixel(rows, x, y).missing(), !holds_node(map.at(x, y), reader.info().nodes[n]));
  }
  EXPECT_NO_THROW(write_png(folder / "a.exr", folder / "a.png"));
}

TEST(SampleMap, AMapOfOneCountIsAPlainFrame) {
  testing::TemporaryFolder folder;
  const FrameHeader header = cropped_header();
  SampleMap map{header.bounds, {}};
  map.counts.assign(map.grid().size(), 20);
  work_of(header, map, 16, 16).merge(folder / "map.exr", {{}, {}, map});
  write_exr(folder / "plain.exr", header, render_nodes(header.bounds, {0, 20}));
  EXPECT_EQ(bytes_of(folder / "map.exr"), bytes_of(folder / "plain.exr"));
}

TEST(SampleMap, FramesWithMapsAreMergedAndExtended) {
  testing::TemporaryFolder folder;
  const FrameHeader header = cropped_header();
  Stream random(4);
  const SampleMap map = random_map(header.bounds, kCounts, random);
  const auto a = folder / "a.exr", b = folder / "b.exr", merged = folder / "merged.exr";
  work_of(header, map, 32, 64).merge(a, {{}, {}, map});
  const std::vector<std::filesystem::path> one{a}, two{a, b};
  merge_files(one, merged);
  EXPECT_EQ(bytes_of(merged), bytes_of(a));

  // What is missing up to 48 everywhere, as a file of its own, makes a plain frame of 48.
  Work rest{std::make_shared<const FrameHeader>(header), {}, {}};
  SampleMap all = map;
  Work both = work_of(header, map, 32, 64);
  for (size_t i = 0; i < map.counts.size(); ++i) {
    for (const SampleRange range : dyadic_nodes({map.counts[i], 48})) both.add(map.grid().block(i), range);
    all.counts[i] = 48;
  }
  both.merge(merged, {{}, {}, all});
  write_exr(folder / "plain.exr", header, render_nodes(header.bounds, {0, 48}));
  EXPECT_EQ(bytes_of(merged), bytes_of(folder / "plain.exr"));

  // A plain range after a mapped frame: what lies between is missing, and listed.
  write_exr(b, header, render_nodes(header.bounds, {40, 48}));
  const NodeFileInfo info = merge_files(two, merged);
  int64_t full = 0;
  for (size_t i = 0; i < map.counts.size(); ++i) full += map.counts[i] == 40 ? map.grid().block(i).area() : 0;
  EXPECT_EQ(info.missing_pixels, header.bounds.area() - full);
  EXPECT_EQ(info.samples, (SampleRange{0, 48}));
}

TEST(SampleMap, GapsAreThoseOfTheMap) {
  testing::TemporaryFolder folder;
  const FrameHeader header = some_header(96, 64);
  const SampleMap map{header.bounds, {16, 20, 0, 24, 16, 16}};
  Work work = work_of(header, map, 32, 64);
  EXPECT_EQ(work.merge(folder / "whole.exr", {{}, {}, map}).missing_pixels, 0);
  EXPECT_EQ(ExrReader(folder / "whole.exr").info().map, map);
  // Without [16, 20) of block 1.
  const auto lost = std::find_if(work.inputs.begin(), work.inputs.end(), [](const MergeInput& i) {
    return i.range == SampleRange{16, 20};
  });
  ASSERT_NE(lost, work.inputs.end());
  work.tiles.erase(work.tiles.begin() + (lost - work.inputs.begin()));
  work.inputs.erase(lost);
  const NodeFileInfo info = work.merge(folder / "gap.exr", {{}, {}, map});
  EXPECT_EQ(info.missing_pixels, 32 * 32);
  EXPECT_EQ(info.gaps, (std::vector<Gap>{{{32, 0, 64, 32}, {16, 20}}}));
  EXPECT_EQ(ExrReader(folder / "gap.exr").info().gaps, info.gaps);
  // More than the map asks for.
  work.add({64, 0, 96, 32}, {0, 8});
  EXPECT_THAT(message_of([&] { work.merge(folder / "more.exr", {{}, {}, map}); }), HasSubstr("asks for 0 only"));
}

TEST(SampleMap, MalformedMapsAreRefused) {
  testing::TemporaryFolder folder;
  const FrameHeader header = some_header(96, 64);
  const SampleMap map{header.bounds, {16, 20, 16, 24, 16, 16}};
  work_of(header, map, 32, 64).merge(folder / "good.exr", {{}, {}, map});
  const std::string good = bytes_of(folder / "good.exr"), text = "16,20,16,24,16x2";
  ASSERT_NO_THROW(decode_exr(good, "good.exr"));
  ASSERT_NE(good.find(text), std::string::npos);
  for (const std::string bad : {"16,20,16,24,16x3", "16,20,16,24,16,1", "16,20,16,20,16x2", "20,16,16,24,16x2", "16,20,16,28,16x2",
                                "16,20,16,24,99x1", "16x6999999999999", "-6,20,16,24,16x2"}) {
    ASSERT_EQ(bad.size(), text.size());
    std::string bytes = good;
    bytes.replace(bytes.find(text), text.size(), bad);
    EXPECT_THROW(decode_exr(bytes, "bad.exr"), FilmError) << bad;
  }
  Stream random(5);
  const size_t end = good.find(text) + text.size();
  for (int trial = 0; trial < 500; ++trial) {
    std::string bytes = good;
    const size_t at = end - 1 - random.next_u32() % 60;
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << (random.next_u32() % 8)));
    try {
      const NodeFile file = decode_exr(bytes, "flipped.exr");
      EXPECT_TRUE(!file.info.map || file.info.map->counts.size() == 6);
    } catch (const FilmError&) {
    }
  }
  EXPECT_THAT(message_of([&] {
                SampleMap other = map;
                other.counts.pop_back();
                work_of(header, map, 32, 64).merge(folder / "other.exr", {{}, {}, other});
              }),
              HasSubstr("not one of its pixels"));
}

}  // namespace
}  // namespace woodcock
