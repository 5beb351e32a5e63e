#include "renderer/film/png.h"

#include <gtest/gtest.h>

#include "renderer/film/exr.h"
#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

TEST(Png, CodesFollowTheSrgbCurve) {
  EXPECT_EQ(srgb8(0), 0);
  EXPECT_EQ(srgb8(1), 255);
  EXPECT_EQ(srgb8(0.5f), 188);
  EXPECT_EQ(srgb8(0.18f), 118);
  EXPECT_EQ(srgb8(0.002f), 7);
  EXPECT_EQ(srgb8(-3), 0);
  EXPECT_EQ(srgb8(1e30f), 255);
}

TEST(Png, IsWrittenBesideAFrameOfAnySampleCount) {
  testing::TemporaryFolder folder;
  for (const int64_t samples : {4, 5}) {
    write_exr(folder / "frame.exr", testing::some_header(33, 129), testing::render_nodes({0, 0, 33, 129}, {0, samples}));
    write_png(folder / "frame.exr", folder / "frame.png");
    const std::string bytes = testing::bytes_of(folder / "frame.png");
    ASSERT_GT(bytes.size(), 33u);
    EXPECT_EQ(bytes.substr(1, 3), "PNG");
    EXPECT_EQ(bytes[19], 33) << "width in the header chunk";
  }
}

}  // namespace
}  // namespace woodcock
