#include "renderer/film/merge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

using testing::bytes_of;
using ::testing::HasSubstr;
using testing::message_of;
using testing::render_nodes;
using testing::render_tile;
using testing::some_header;

/// Splits pixels × samples at random into tiles.
void split(PixelRect rect, SampleRange range, Stream& random, std::vector<std::pair<PixelRect, SampleRange>>& tiles) {
  const float kind = random.uniform();
  if (kind < 0.35f && rect.width() > 1) {
    const int x = rect.x0 + 1 + static_cast<int>(random.next_u32() % static_cast<unsigned>(rect.width() - 1));
    split({rect.x0, rect.y0, x, rect.y1}, range, random, tiles);
    split({x, rect.y0, rect.x1, rect.y1}, range, random, tiles);
  } else if (kind < 0.6f && rect.height() > 1) {
    const int y = rect.y0 + 1 + static_cast<int>(random.next_u32() % static_cast<unsigned>(rect.height() - 1));
    split({rect.x0, rect.y0, rect.x1, y}, range, random, tiles);
    split({rect.x0, y, rect.x1, rect.y1}, range, random, tiles);
  } else if (kind < 0.85f && range.size() > 1) {
    split(rect, left_child(range), random, tiles);
    split(rect, right_child(range), random, tiles);
  } else {
    tiles.emplace_back(rect, range);
  }
}

struct Work {
  std::vector<MergeInput> inputs;
  std::vector<Tile> tiles;

  void add(const std::shared_ptr<const FrameHeader>& header, PixelRect rect, SampleRange range, std::string name = "") {
    inputs.push_back({name.empty() ? "tile " + std::to_string(inputs.size()) : name, header, rect, range});
    tiles.push_back(render_tile(rect, range));
  }
  TileLoader loader() const {
    return [this](size_t i) { return tiles[i]; };
  }
};

TEST(Merge, AnySplitInAnyOrderMakesTheBytesOfTheWholeFrame) {
  testing::TemporaryFolder folder;
  Stream random(1);
  for (int trial = 0; trial < 40; ++trial) {
    const int width = 1 + static_cast<int>(random.next_u32() % 70), height = 1 + static_cast<int>(random.next_u32() % 150);
    auto header = some_header(width + 10, height + 10);
    header.bounds = {3, 4, 3 + width, 4 + height};
    const auto shared = std::make_shared<const FrameHeader>(header);
    const SampleRange samples{trial % 3 == 0 ? 3 : 0, 4 + static_cast<int64_t>(random.next_u32() % 9)};
    write_exr(folder / "whole.exr", header, render_nodes(header.bounds, samples));
    std::vector<std::pair<PixelRect, SampleRange>> parts;
    for (const SampleRange node : dyadic_nodes(samples)) split(header.bounds, node, random, parts);
    for (size_t i = parts.size(); i > 1; --i) std::swap(parts[i - 1], parts[random.next_u32() % i]);
    Work work;
    for (const auto& [rect, range] : parts) work.add(shared, rect, range);
    const NodeFileInfo info = merge_tiles(work.inputs, work.loader(), folder / "merged.exr");
    EXPECT_TRUE(info.gaps.empty());
    ASSERT_EQ(bytes_of(folder / "merged.exr"), bytes_of(folder / "whole.exr")) << "trial " << trial << ", " << parts.size() << " tiles";
  }
}

TEST(Merge, FilesOfTilesAndOfEarlierFramesMakeTheSameBytes) {
  testing::TemporaryFolder folder;
  const FrameHeader header = some_header(40, 150);
  const PixelRect top{0, 0, 40, 70}, bottom{0, 70, 40, 150};
  write_exr(folder / "early.exr", header, render_nodes(header.bounds, {0, 5}));  // nodes 0:4 and 4:5
  write_exr(folder / "more.exr", header, render_nodes(header.bounds, {5, 8}));
  write_exr(folder / "top.exr", header, render_nodes(top, {8, 16}));
  write_exr(folder / "bottom.exr", header, render_nodes(bottom, {8, 16}));
  const std::vector<std::filesystem::path> files = {folder / "top.exr", folder / "more.exr", folder / "bottom.exr", folder / "early.exr"};
  merge_files(files, folder / "merged.exr");
  write_exr(folder / "whole.exr", header, render_nodes(header.bounds, {0, 16}));
  EXPECT_EQ(bytes_of(folder / "merged.exr"), bytes_of(folder / "whole.exr"));
}

TEST(Merge, RefusesOverlapsNamingBothFiles) {
  const auto header = std::make_shared<const FrameHeader>(some_header(100, 100));
  Work work;
  work.add(header, {0, 0, 10, 10}, {0, 4}, "a.exr");
  work.add(header, {10, 0, 20, 10}, {0, 4}, "b.exr");
  work.add(header, {0, 0, 10, 10}, {4, 8}, "c.exr");
  EXPECT_NO_THROW(plan_merge(work.inputs));
  Work same = work;
  same.add(header, {9, 9, 12, 12}, {2, 3}, "d.exr");
  EXPECT_THAT(message_of([&] { plan_merge(same.inputs); }), AllOf(HasSubstr("d.exr"), HasSubstr("overlap"), HasSubstr("2:3")));
  Work twice = work;
  twice.add(header, {0, 0, 10, 10}, {4, 8}, "e.exr");
  EXPECT_THAT(message_of([&] { plan_merge(twice.inputs); }), AllOf(HasSubstr("c.exr"), HasSubstr("e.exr")));
}

TEST(Merge, RefusesTilesOfDifferentFramesNamingBothValues) {
  const FrameHeader header = some_header(100, 100);
  const auto refused = [&](const char* value, auto change) {
    FrameHeader other = header;
    change(other);
    Work work;
    work.add(std::make_shared<const FrameHeader>(header), {0, 0, 10, 10}, {0, 1}, "a.exr");
    work.add(std::make_shared<const FrameHeader>(other), {10, 0, 20, 10}, {0, 1}, "b.exr");
    EXPECT_THAT(message_of([&] { plan_merge(work.inputs); }), AllOf(HasSubstr("a.exr"), HasSubstr("b.exr"), HasSubstr(value)));
  };
  refused("'123'", [](FrameHeader& h) { h.seed = 123; });
  refused("dddd", [](FrameHeader& h) { h.scene_digest = std::string(64, 'd'); });
  refused("dddd", [](FrameHeader& h) { h.settings_digest = std::string(64, 'd'); });
  refused("dddd", [](FrameHeader& h) { h.arithmetic_class = std::string(64, 'd'); });
  refused("other build", [](FrameHeader& h) { h.build = "other build"; });
  refused("march", [](FrameHeader& h) { h.settings[0].second = "march"; });
}

TEST(Merge, GapsAreCountedListedAndBlack) {
  testing::TemporaryFolder folder;
  const auto header = std::make_shared<const FrameHeader>(some_header(30, 100));
  Work work;
  work.add(header, {0, 0, 30, 60}, {0, 4});
  work.add(header, {0, 60, 30, 100}, {0, 2});  // misses 2:4
  work.add(header, {0, 0, 10, 100}, {4, 5});   // the pixels right of it miss 4:5
  const NodeFileInfo info = merge_tiles(work.inputs, work.loader(), folder / "partial.exr");
  EXPECT_EQ(info.gaps, (std::vector<Gap>{{{0, 60, 30, 100}, {2, 4}}, {{10, 0, 30, 100}, {4, 5}}}));
  EXPECT_EQ(info.missing_pixels, 30 * 40 + 20 * 60);
  ExrReader reader(folder / "partial.exr");
  EXPECT_EQ(reader.info().gaps, info.gaps);
  EXPECT_EQ(reader.info().missing_pixels, info.missing_pixels);
  const auto picture = reader.beauty_rows(0, 100);
  int64_t holes = 0;
  for (const PixelStats& pixel : picture) {
    if (!pixel.missing()) continue;
    ++holes;
    EXPECT_EQ(pixel.mean, Rgb(0)) << "no average of what is there";
  }
  EXPECT_EQ(holes, info.missing_pixels);
  EXPECT_EQ(picture[0].count, 5);
  // The nodes keep what was rendered whole.
  EXPECT_EQ(reader.node_rows(0, 0, 1)[20].count, 4);
  const std::vector<std::filesystem::path> again = {folder / "partial.exr"};
  EXPECT_THAT(message_of([&] { merge_files(again, folder / "x.exr"); }), HasSubstr("miss samples"));
}

TEST(Merge, ATargetSetsPixelsAndSamplesAndRefusesWhatIsOutside) {
  const auto header = std::make_shared<const FrameHeader>(some_header(30, 30));
  Work work;
  work.add(header, {0, 0, 30, 30}, {0, 4});
  MergeTarget target;
  target.samples = {0, 8};
  const NodeFileInfo info = plan_merge(work.inputs, target);
  EXPECT_EQ(info.gaps, (std::vector<Gap>{{{0, 0, 30, 30}, {4, 8}}}));
  target.samples = {0, 2};
  EXPECT_THROW(plan_merge(work.inputs, target), FilmError);
  target = {};
  target.rect = {0, 0, 10, 10};
  EXPECT_THROW(plan_merge(work.inputs, target), FilmError);
}

TEST(Merge, ALoaderThatGivesAnotherTileIsRefusedAndLeavesNoFile) {
  testing::TemporaryFolder folder;
  const auto header = std::make_shared<const FrameHeader>(some_header(8, 8));
  Work work;
  work.add(header, {0, 0, 8, 8}, {0, 4}, "tile.exr");
  work.tiles[0].pixels[5].count = 2;
  EXPECT_THAT(message_of([&] { merge_tiles(work.inputs, work.loader(), folder / "out.exr"); }), HasSubstr("tile.exr"));
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace woodcock
