#include "renderer/film/exr.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

using testing::bytes_of;
using ::testing::HasSubstr;
using testing::message_of;
using testing::render_nodes;
using testing::same_bits;
using testing::some_header;

TEST(Exr, TilesComeBackToTheBit) {
  testing::TemporaryFolder folder;
  const FrameHeader header = some_header(100, 50);
  for (const SampleRange samples : {SampleRange{0, 16}, SampleRange{8, 12}, SampleRange{0, 5}, SampleRange{3, 21}}) {
    const auto nodes = render_nodes({10, 5, 47, 40}, samples);
    write_exr(folder / "tile.exr", header, nodes);
    const NodeFile file = read_exr(folder / "tile.exr");
    EXPECT_EQ(file.info.header, header);
    EXPECT_EQ(file.info.samples, samples);
    ASSERT_EQ(file.nodes.size(), nodes.size());
    for (size_t i = 0; i < nodes.size(); ++i) EXPECT_TRUE(same_bits(file.nodes[i], nodes[i]));
    EXPECT_EQ(digest_of_pixels(header, nodes), digest_of_pixels(file.info.header, file.nodes));
  }
}

TEST(Exr, AFrameWithoutSettingsComesBackAndOneWithAnEmptySettingIsRefused) {
  FrameHeader header = some_header(20, 10);
  header.settings.clear();
  const auto nodes = render_nodes({0, 0, 20, 10}, {0, 4});
  EXPECT_EQ(decode_exr(encode_exr(header, nodes), "frame").info.header, header);
  header.settings = {{"estimator", ""}};
  EXPECT_THAT(message_of([&] { encode_exr(header, nodes); }), HasSubstr("estimator"));
}

TEST(Exr, ThePictureOfAnyRangeIsTheFoldOfItsNodes) {
  const FrameHeader header = some_header(20, 10);
  const SampleRange samples{0, 7};
  const auto nodes = render_nodes({0, 0, 20, 10}, samples);
  const std::string bytes = encode_exr(header, nodes);
  ExrReader reader(bytes, "frame");
  const auto picture = reader.beauty_rows(3, 10);
  std::vector<PixelStats> of_pixel;
  for (const Tile& node : nodes) of_pixel.push_back(node.at(4, 5));
  EXPECT_TRUE(same_bits(picture[2 * 20 + 4], fold(dyadic_nodes(samples), of_pixel)));
}

TEST(Exr, EqualContentMakesEqualBytesInFilesAndInMemory) {
  testing::TemporaryFolder folder;
  const FrameHeader header = some_header(100, 50);
  for (const SampleRange samples : {SampleRange{0, 8}, SampleRange{0, 11}}) {
    const auto nodes = render_nodes({0, 0, 64, 33}, samples);
    write_exr(folder / "a.exr", header, nodes);
    write_exr(folder / "b.exr", header, nodes);
    EXPECT_EQ(bytes_of(folder / "a.exr"), bytes_of(folder / "b.exr"));
    EXPECT_EQ(bytes_of(folder / "a.exr"), encode_exr(header, nodes));
  }
}

TEST(Exr, HoldsNoDateHostOrProgram) {
  const std::string bytes = encode_exr(some_header(8, 8), render_nodes({0, 0, 8, 8}, {0, 1}));
  for (const char* trace : {"Software", "software", "host", "oiio", "20"})
    EXPECT_EQ(bytes.substr(0, 1500).find(trace), std::string::npos) << trace;
}

TEST(Exr, AovsOutsideTheSetAreLeftOutAndStatisticsStay) {
  FrameHeader header = some_header(16, 16);
  header.aovs = {false, true, false};
  const auto nodes = render_nodes({0, 0, 16, 16}, {0, 4});
  const NodeFile file = decode_exr(encode_exr(header, nodes), "tile");
  const PixelStats &in = nodes[0].at(3, 3), &out = file.nodes[0].at(3, 3);
  EXPECT_EQ(out.albedo, Rgb(0));
  EXPECT_EQ(out.depth, 0);
  EXPECT_EQ(out.normal, in.normal);
  EXPECT_EQ(out.deviation, in.deviation);
  EXPECT_EQ(out.replicate, in.replicate);
  EXPECT_LT(encode_exr(header, nodes).size(), encode_exr(some_header(16, 16), nodes).size());
}

TEST(Exr, NeverWritesANumberThatIsNotFinite) {
  testing::TemporaryFolder folder;
  for (const float bad : {kInf, -kInf, std::nanf("")}) {
    auto nodes = render_nodes({4, 4, 12, 12}, {0, 2});
    nodes[0].pixels[9].deviation.g = bad;
    EXPECT_THAT(message_of([&] { write_exr(folder / "x.exr", some_header(16, 16), nodes); }), HasSubstr("deviation.G of pixel (5, 5)"));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder.path())) << "neither a half file nor a temporary one is left";
}

TEST(Exr, RefusesNodesThatDoNotFitTogether) {
  const FrameHeader header = some_header(16, 16);
  auto nodes = render_nodes({0, 0, 8, 8}, {0, 6});
  std::swap(nodes[0], nodes[1]);
  EXPECT_THROW(encode_exr(header, nodes), FilmError);
  EXPECT_THROW(encode_exr(header, {}), FilmError);
  EXPECT_THAT(message_of([&] { encode_exr(header, render_nodes({0, 0, 17, 4}, {0, 1})); }), HasSubstr("bounds"));
}

TEST(Exr, ATruncatedFileIsRefusedWithItsName) {
  for (const SampleRange samples : {SampleRange{0, 4}, SampleRange{0, 5}}) {
    const std::string bytes = encode_exr(some_header(32, 32), render_nodes({0, 0, 32, 32}, samples));
    for (size_t size : {size_t{0}, size_t{3}, size_t{100}, bytes.size() / 4, bytes.size() / 2, bytes.size() - 1})
      EXPECT_THAT(message_of([&] { decode_exr(std::string_view(bytes).substr(0, size), "cut.exr"); }), HasSubstr("cut.exr")) << size;
  }
}

TEST(Exr, AFlippedBitIsRefusedOrLeavesValidNumbers) {
  // The file has no checksum of its own (a digest travels beside it); what must hold is that reading either refuses or
  // gives finite statistics with the right counts, and never crashes.
  const std::string good = encode_exr(some_header(24, 24), render_nodes({0, 0, 24, 24}, {0, 3}));
  Stream random(1);
  int refused = 0;
  for (int trial = 0; trial < 1500; ++trial) {
    std::string bytes = good;
    // Half of the flips hit the headers.
    const size_t at = random.next_u64() % (trial % 2 ? bytes.size() : std::min<size_t>(bytes.size(), 4000));
    bytes[at] = static_cast<char>(bytes[at] ^ (1 << (random.next_u32() % 8)));
    try {
      for (const Tile& node : decode_exr(bytes, "flipped.exr").nodes)
        for (const PixelStats& pixel : node.pixels)
          ASSERT_TRUE(is_finite(pixel.mean) && pixel.count == static_cast<float>(node.range.size()));
    } catch (const FilmError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 500);
}

/// `bytes` with the 32-bit number at `offset` behind the first `key` replaced.
std::string patched(std::string bytes, std::string_view key, size_t offset, int32_t value) {
  const size_t at = bytes.find(key) + key.size() + offset;
  std::memcpy(bytes.data() + at, &value, sizeof value);
  return bytes;
}

TEST(Exr, PromisesOfHugeSizesAreRefusedBeforeAnythingIsAllocated) {
  const std::string bytes = encode_exr(some_header(32, 32), render_nodes({0, 0, 32, 32}, {0, 2}));
  // A box is behind its name's zero, "box2i", another zero, and its size in 4 bytes.
  const auto window = [&](int32_t x1, int32_t y1) { return patched(patched(bytes, "dataWindow", 11 + 8, x1), "dataWindow", 11 + 12, y1); };
  const auto refused = [](const std::string& b, const char* why) {
    EXPECT_THAT(message_of([&] { decode_exr(b, "huge.exr"); }), AllOf(HasSubstr("huge.exr"), HasSubstr(why)));
  };
  refused(window(2147483647, 2147483647), "outside");
  refused(window(-5, 31), "outside");
  refused(window(65535, 65535), "too large");
  refused(window(16383, 16383), "too short");
  refused(patched(bytes, "dataWindow", 7, 2000000000), "impossible size");
  EXPECT_THAT(message_of([&] { decode_exr(bytes, "tile.exr", 32 * 31); }), HasSubstr("allowed"));
  EXPECT_NO_THROW(decode_exr(bytes, "tile.exr", 32 * 32));
}

TEST(Exr, RandomBytesAreRefused) {
  Stream random(2);
  for (int trial = 0; trial < 500; ++trial) {
    std::string bytes(random.next_u32() % 400, '\0');
    for (char& c : bytes) c = static_cast<char>(random.next_u32());
    if (bytes.size() > 8) std::memcpy(bytes.data(), "\x76\x2f\x31\x01\x02\0\0\0", 8);
    EXPECT_THROW(decode_exr(bytes, "noise.exr"), FilmError);
  }
}

TEST(ResultKey, DependsOnEveryFieldAndOnNothingElse) {
  const FrameHeader header = some_header(64, 64);
  const std::string key = result_key(header, {0, 0, 8, 8}, {0, 4});
  EXPECT_EQ(key.size(), 64u);
  EXPECT_EQ(key, result_key(some_header(64, 64), {0, 0, 8, 8}, {0, 4}));
  EXPECT_NE(key, result_key(header, {0, 0, 8, 16}, {0, 4}));
  EXPECT_NE(key, result_key(header, {0, 0, 8, 8}, {4, 8}));
  const auto changed = [&](auto change) {
    FrameHeader other = header;
    change(other);
    EXPECT_NE(key, result_key(other, {0, 0, 8, 8}, {0, 4}));
    EXPECT_NE(header_difference(header, "a.exr", other, "b.exr"), "");
  };
  changed([](FrameHeader& h) { h.scene_digest[0] = '0'; });
  changed([](FrameHeader& h) { h.settings_digest[0] = '0'; });
  changed([](FrameHeader& h) { h.seed = 1; });
  changed([](FrameHeader& h) { h.frame = 8; });
  changed([](FrameHeader& h) { h.width = 65; });
  changed([](FrameHeader& h) { h.bounds.x1 = 63; });
  changed([](FrameHeader& h) { h.build += "1"; });
  changed([](FrameHeader& h) { h.arithmetic_class[0] = '0'; });
  changed([](FrameHeader& h) { h.aovs.depth = false; });
  changed([](FrameHeader& h) { h.settings[2].second = "5"; });
  changed([](FrameHeader& h) { h.settings.pop_back(); });
}

}  // namespace
}  // namespace woodcock
