#include "renderer/accuracy/compare.h"

#include <gtest/gtest.h>

#include "renderer/film/exr.h"
#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

void write_constant(const std::filesystem::path& path, int width, float value) {
  Tile tile{{0, 0, width, 4}, {0, 1}, {}};
  for (int64_t i = 0; i < tile.rect.area(); ++i) tile.pixels.push_back(leaf(Rgb(value), {}, 0));
  write_exr(path, testing::some_header(width, 4), std::span(&tile, 1));
}

TEST(Compare, MeasuresAKnownDifference) {
  testing::TemporaryFolder folder;
  write_constant(folder / "a.exr", 8, 2.5f);
  write_constant(folder / "r.exr", 8, 2);
  const PictureDifference d = compare_pictures(folder / "a.exr", folder / "r.exr");
  EXPECT_DOUBLE_EQ(d.mse, 0.25);
  EXPECT_NEAR(d.relative_mse, 0.25 / (4 * 1.0001), 1e-6);
  EXPECT_NEAR(d.psnr, 10 * std::log10(16), 1e-9);
  EXPECT_NEAR(d.mean - d.reference_mean, 0.5, 1e-6);
  EXPECT_EQ(compare_pictures(folder / "r.exr", folder / "r.exr").psnr, std::numeric_limits<double>::infinity());
}

TEST(Compare, RefusesPicturesOfDifferentSizesAndFilesThatAreNone) {
  testing::TemporaryFolder folder;
  write_constant(folder / "a.exr", 8, 1);
  write_constant(folder / "b.exr", 9, 1);
  EXPECT_THROW(compare_pictures(folder / "a.exr", folder / "b.exr"), FilmError);
  EXPECT_THROW(compare_pictures(folder / "a.exr", folder / "nowhere.exr"), FilmError);
}

}  // namespace
}  // namespace woodcock
