// The picture: what the simplest readers find in it, and what holds it and its nodes together.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cctype>
#include <set>

#include "renderer/film/merge.h"
#include "renderer/film/picture_file.h"
#include "tests/film/random_tiles.h"
#include "tests/film/small_readers.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;
using testing::bytes_of;
using ::testing::HasSubstr;
using testing::message_of;
using testing::render_nodes;
using testing::some_header;

void write_frame(const fs::path& picture, const FrameHeader& header, SampleRange samples) {
  write_exr(nodes_path(picture), header, render_nodes(header.bounds, samples), nullptr, picture);
}

/// The rules by which readers that look at names alone find a colour: the channel of that name, whatever follows the last dot, in
/// either case, or the name's end.
std::vector<std::string> taken_for(char colour, const std::vector<std::string>& channels) {
  std::vector<std::string> taken;
  for (const std::string& channel : channels) {
    const std::string last = channel.substr(channel.rfind('.') + 1);
    if (last.size() == 1 && std::toupper(static_cast<unsigned char>(last[0])) == colour) taken.push_back(channel);
    if (last.size() > 1 && last.back() == colour) taken.push_back(channel);
  }
  return taken;
}

/// One part stored by rows, R, G and B where every reader looks, the pixels where they belong, and the colours of the nodes' fold.
void expect_simple(const fs::path& path) {
  ExrReader nodes(nodes_path(path));
  const FrameHeader& header = nodes.info().header;
  const PixelRect rect = nodes.info().rect;
  const testing::SmallHeader small = testing::read_header(path);
  EXPECT_TRUE(small.plain());
  EXPECT_EQ((PixelRect{small.data.min_x, small.data.min_y, small.data.max_x + 1, small.data.max_y + 1}), rect);
  EXPECT_EQ((PixelRect{small.display.min_x, small.display.min_y, small.display.max_x + 1, small.display.max_y + 1}),
            (PixelRect{0, 0, header.width, header.height}));
  ASSERT_GE(small.channels.size(), 4u);
  EXPECT_EQ(std::vector(small.channels.begin(), small.channels.begin() + 3), (std::vector<std::string>{"B", "G", "R"}));
  for (const char colour : {'R', 'G', 'B'}) EXPECT_EQ(taken_for(colour, small.channels), std::vector<std::string>{std::string(1, colour)});
  EXPECT_TRUE(taken_for('A', small.channels).empty());

  const auto rows = nodes.beauty_rows(rect.y0, rect.y1);
  const testing::SmallPicture picture = testing::load_exr(path);
  ASSERT_EQ(picture.width, rect.width());
  ASSERT_EQ(picture.height, rect.height());
  const auto input = OIIO::ImageInput::open(path.string());
  ASSERT_TRUE(input);
  ASSERT_FALSE(input->seek_subimage(1, 0)) << "one part";
  ASSERT_TRUE(input->seek_subimage(0, 0));
  EXPECT_EQ(input->spec().alpha_channel, -1);
  std::vector<float> rgb(3 * rows.size());
  ASSERT_TRUE(input->read_image(0, 0, 0, 3, OIIO::TypeFloat, rgb.data()));
  EXPECT_EQ(std::vector(input->spec().channelnames.begin(), input->spec().channelnames.begin() + 3),
            (std::vector<std::string>{"R", "G", "B"}));
  for (size_t p = 0; p < rows.size(); ++p) {
    for (int c = 0; c < 3; ++c) {
      ASSERT_EQ(picture.rgba[4 * p + static_cast<size_t>(c)], rows[p].mean[c]) << "pixel " << p;
      ASSERT_EQ(rgb[3 * p + static_cast<size_t>(c)], rows[p].mean[c]) << "pixel " << p;
    }
    ASSERT_EQ(picture.rgba[4 * p + 3], 1) << "opaque";
  }
}

FrameHeader cropped(AovSet aovs) {
  FrameHeader header = some_header(40, 30);
  header.bounds = {7, 5, 33, 28};
  header.aovs = aovs;
  return header;
}

TEST(Picture, OfAnyNumberOfSamplesIsOnePartWhoseColourTheSimplestReaderFinds) {
  testing::TemporaryFolder folder;
  for (int64_t n = 1; n <= 40; ++n) {
    SCOPED_TRACE(n);
    const FrameHeader header = n % 2 ? cropped({(n & 2) != 0, (n & 4) != 0, (n & 8) != 0}) : some_header(9, 21);
    write_frame(folder / "a.exr", header, {0, n});
    expect_simple(folder / "a.exr");
    EXPECT_EQ(nodes_of(folder / "a.exr"), folder / "a.nodes.exr");
  }
}

TEST(Picture, OfAnyAovsAndAnyRangeIsAsSimple) {
  testing::TemporaryFolder folder;
  for (int set = 0; set < 8; ++set)
    for (const SampleRange samples : {SampleRange{0, 16}, SampleRange{5, 21}}) {
      SCOPED_TRACE(set);
      write_frame(folder / "a.exr", cropped({(set & 1) != 0, (set & 2) != 0, (set & 4) != 0}), samples);
      expect_simple(folder / "a.exr");
    }
}

/// Blocks of these counts in two rows of two: some without samples.
NodeFileInfo merge_map(const fs::path& picture, const std::vector<int64_t>& counts) {
  const FrameHeader header = cropped({});
  const SampleMap map{header.bounds, counts};
  const auto shared = std::make_shared<const FrameHeader>(header);
  std::vector<MergeInput> inputs;
  std::vector<Tile> tiles;
  for (size_t b = 0; b < counts.size(); ++b)
    for (const SampleRange range : dyadic_nodes({0, counts[b]})) {
      tiles.push_back(testing::render_tile(map.grid().block(b), range));
      inputs.push_back({"a tile", shared, tiles.back().rect, range});
    }
  return merge_tiles(
      inputs, [&](size_t i) { return tiles[i]; }, nodes_path(picture), {{}, {}, map}, nullptr, picture);
}

TEST(Picture, OfASampleMapIsAsSimple) {
  testing::TemporaryFolder folder;
  Stream random(11);
  constexpr int64_t kCounts[] = {0, 1, 16, 20, 24, 33, 40};
  for (int trial = 0; trial < 12; ++trial) {
    SCOPED_TRACE(trial);
    std::vector<int64_t> counts(2);
    for (int64_t& n : counts) n = kCounts[random.next_u32() % std::size(kCounts)];
    if (counts[0] + counts[1] == 0) counts[0] = 24;
    merge_map(folder / "a.exr", counts);
    expect_simple(folder / "a.exr");
    EXPECT_EQ(look_at(folder / "a.exr").info.map, look_at(folder / "a.nodes.exr").info.map);
  }
}

TEST(Picture, SaysWhatItsNodesSay) {
  testing::TemporaryFolder folder;
  const PictureSummary summary{[](SampleRange) { return std::vector<std::string>{"error.pixels"}; },
                               [](const fs::path&, SampleRange) { return std::vector<float>{7}; }};
  const FrameHeader header = cropped({});
  write_exr(folder / "a.nodes.exr", header, render_nodes(header.bounds, {0, 5}), &summary, folder / "a.exr");
  const FrameFile picture = look_at(folder / "a.exr"), nodes = look_at(folder / "a.nodes.exr");
  EXPECT_EQ(picture.kind, FrameFile::Kind::kPicture);
  EXPECT_EQ(nodes.kind, FrameFile::Kind::kNodes);
  EXPECT_EQ(picture.info.header, header);
  EXPECT_EQ(picture.info.samples, nodes.info.samples);
  EXPECT_EQ(picture.info.rect, nodes.info.rect);
  const auto input = OIIO::ImageInput::open((folder / "a.exr").string());
  ASSERT_TRUE(input);
  EXPECT_EQ(input->spec().get_float_attribute("woodcock:error.pixels"), 7);
}

TEST(Picture, OfEqualNodesHasEqualBytesAndHoldsNoDateHostOrProgram) {
  testing::TemporaryFolder folder;
  write_frame(folder / "a.exr", some_header(8, 8), {0, 3});
  write_frame(folder / "b.exr", some_header(8, 8), {0, 3});
  EXPECT_EQ(bytes_of(folder / "a.exr"), bytes_of(folder / "b.exr"));
  make_picture(folder / "a.nodes.exr", folder / "c.exr")->commit();
  EXPECT_EQ(bytes_of(folder / "a.exr"), bytes_of(folder / "c.exr"));
  const std::string bytes = bytes_of(folder / "a.exr");
  for (const char* trace : {"Software", "software", "host", "oiio"}) EXPECT_EQ(bytes.find(trace), std::string::npos) << trace;
  const auto input = OIIO::ImageInput::open((folder / "a.exr").string());
  ASSERT_TRUE(input);
  EXPECT_EQ(input->spec().get_string_attribute("DateTime"), "");
}

TEST(Picture, WithoutItsNodesOrWithOthersIsRefusedByName) {
  testing::TemporaryFolder folder;
  const fs::path a = folder / "a.exr", nodes = folder / "a.nodes.exr";
  write_frame(a, some_header(8, 8), {0, 3});
  write_frame(folder / "b.exr", some_header(8, 8), {0, 5});
  const std::string right = bytes_of(nodes);

  fs::copy_file(folder / "b.nodes.exr", nodes, fs::copy_options::overwrite_existing);
  EXPECT_THAT(message_of([&] { nodes_of(a); }),
              AllOf(HasSubstr("a.nodes.exr"), HasSubstr("does not belong to"), HasSubstr("woodcock merge")));
  EXPECT_THAT(message_of([&] { nodes_to_resume(a); }), HasSubstr("does not belong to"));

  // One wrong bit is enough.
  std::string wrong = right;
  wrong[wrong.size() / 2] = static_cast<char>(wrong[wrong.size() / 2] ^ 1);
  std::ofstream(nodes, std::ios::binary) << wrong;
  EXPECT_THAT(message_of([&] { nodes_of(a); }), HasSubstr("does not belong to"));

  fs::remove(nodes);
  EXPECT_THAT(message_of([&] { nodes_of(a); }), AllOf(HasSubstr("a.exr"), HasSubstr("a.nodes.exr"), HasSubstr("put that file back")));
  EXPECT_THAT(message_of([&] { ExrReader reader(a); }), HasSubstr("is a picture"));

  std::ofstream(nodes, std::ios::binary) << right;
  EXPECT_EQ(nodes_of(a), nodes);
}

TEST(Picture, ThatAStopKeptFromItsNewNodesIsMadeAgainByAMerge) {
  testing::TemporaryFolder folder;
  const fs::path a = folder / "a.exr", nodes = folder / "a.nodes.exr";
  write_frame(folder / "later.exr", some_header(8, 8), {0, 5});
  write_frame(a, some_header(8, 8), {0, 3});
  // The state between the two renames.
  fs::copy_file(folder / "later.nodes.exr", nodes, fs::copy_options::overwrite_existing);
  EXPECT_EQ(nodes_of(nodes), nodes);
  const std::vector<fs::path> one{nodes};
  merge_files(one, nodes, {}, nullptr, a);
  EXPECT_EQ(bytes_of(a), bytes_of(folder / "later.exr"));
  EXPECT_EQ(bytes_of(nodes_of(a)), bytes_of(folder / "later.nodes.exr"));
}

TEST(Picture, OfAnEarlierVersionIsItsOwnNodes) {
  testing::TemporaryFolder folder;
  const fs::path old = folder / "old.exr";
  write_exr(old, some_header(8, 8), render_nodes({0, 0, 8, 8}, {0, 3}));
  EXPECT_EQ(nodes_of(old), old);
  EXPECT_EQ(nodes_to_resume(old), old);
  // The state between the two renames of a render that went on from it.
  write_exr(folder / "old.nodes.exr", some_header(8, 8), render_nodes({0, 0, 8, 8}, {0, 5}));
  EXPECT_THAT(message_of([&] { nodes_to_resume(old); }), AllOf(HasSubstr("old.exr"), HasSubstr("old.nodes.exr"), HasSubstr("move away")));
}

TEST(Picture, IsResumedFromItsNodesAloneAndFromNothingElse) {
  testing::TemporaryFolder folder;
  const fs::path a = folder / "a.exr";
  EXPECT_EQ(nodes_to_resume(a), std::nullopt);
  write_frame(a, some_header(8, 8), {0, 3});
  EXPECT_EQ(nodes_to_resume(a), folder / "a.nodes.exr");
  fs::remove(a);
  EXPECT_EQ(nodes_to_resume(a), folder / "a.nodes.exr");
  std::ofstream(a) << "something else";
  EXPECT_THAT(message_of([&] { nodes_to_resume(a); }), HasSubstr("neither a picture nor a node file"));
}

TEST(Picture, ThatCannotBeWrittenLeavesTheOldPairAsItWas) {
  testing::TemporaryFolder folder;
  const fs::path a = folder / "a.exr";
  write_frame(a, some_header(8, 8), {0, 3});
  const std::string picture = bytes_of(a), nodes = bytes_of(folder / "a.nodes.exr");
  const auto more = render_nodes({0, 0, 8, 8}, {0, 5});
  EXPECT_THROW(write_exr(folder / "a.nodes.exr", some_header(8, 8), more, nullptr, folder / "no/such/folder/a.exr"), FilmError);
  EXPECT_EQ(bytes_of(a), picture);
  EXPECT_EQ(bytes_of(folder / "a.nodes.exr"), nodes);
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder.path())) names.insert(entry.path().filename());
  EXPECT_EQ(names, (std::set<std::string>{"a.exr", "a.nodes.exr"})) << "no temporary file is left";
}

TEST(Picture, WithAFlippedBitInItsHeaderIsRefusedOrStillNamesItsNodes) {
  testing::TemporaryFolder folder;
  const fs::path a = folder / "a.exr";
  write_frame(a, some_header(8, 8), {0, 3});
  const std::string good = bytes_of(a);
  Stream random(3);
  int refused = 0, foreign = 0;
  for (int trial = 0; trial < 400; ++trial) {
    std::string bytes = good;
    const size_t at = random.next_u64() % std::min<size_t>(bytes.size(), 2500);
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << (random.next_u32() % 8)));
    std::ofstream(a, std::ios::binary) << bytes;
    try {
      foreign += look_at(a).kind == FrameFile::Kind::kOther;
      const fs::path nodes = nodes_of(a);
      EXPECT_EQ(nodes, folder / "a.nodes.exr");
    } catch (const FilmError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 100);
  EXPECT_GT(foreign, 20);
}

}  // namespace
}  // namespace woodcock
