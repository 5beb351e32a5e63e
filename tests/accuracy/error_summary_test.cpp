#include "renderer/accuracy/error_summary.h"

#include <OpenImageIO/imageio.h>
#include <gtest/gtest.h>

#include <fstream>

#include "renderer/accuracy/error.h"
#include "renderer/film/merge.h"
#include "tests/film/random_tiles.h"

namespace woodcock {
namespace {

namespace fs = std::filesystem;

std::optional<float> number(const fs::path& file, const std::string& name) {
  const auto input = OIIO::ImageInput::open(file.string());
  const auto* value = input ? input->spec().find_attribute("woodcock:error." + name, OIIO::TypeFloat) : nullptr;
  return value ? std::optional(value->get_float()) : std::nullopt;
}

std::string bytes_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(ErrorSummary, SaysWhatTheFileItselfSays) {
  testing::TemporaryFolder folder;
  for (const SampleRange range : {SampleRange{0, 64}, SampleRange{0, 100}, SampleRange{0, 6}}) {
    write_exr(folder / "frame.exr", testing::some_header(9, 40), testing::render_nodes({0, 0, 9, 40}, range), &kErrorSummary);
    const ErrorEstimate error = estimate_error(folder / "frame.exr");
    EXPECT_EQ(number(folder / "frame.exr", "pixels"), 360.0f);
    EXPECT_EQ(number(folder / "frame.exr", "degrees"), static_cast<float>(error.degrees));
    EXPECT_EQ(number(folder / "frame.exr", "image_mean"), static_cast<float>(error.image_mean));
    EXPECT_EQ(number(folder / "frame.exr", "relative_error"), static_cast<float>(error.relative_error->value));
    EXPECT_EQ(number(folder / "frame.exr", "relative_mse"), static_cast<float>(*error.relative_mse));
    EXPECT_EQ(number(folder / "frame.exr", "mean_degrees"), static_cast<float>(*error.image_mean_degrees));
    EXPECT_EQ(number(folder / "frame.exr", "image_mean_error"), static_cast<float>(*error.image_mean_standard_error));
    EXPECT_EQ(number(folder / "frame.exr", "firefly_share").has_value(), range.size() >= 64);
  }
}

TEST(ErrorSummary, OfOneSampleHasNoErrors) {
  testing::TemporaryFolder folder;
  write_exr(folder / "frame.exr", testing::some_header(9, 4), testing::render_nodes({0, 0, 9, 4}, {0, 1}), &kErrorSummary);
  EXPECT_TRUE(number(folder / "frame.exr", "image_mean").has_value());
  EXPECT_FALSE(number(folder / "frame.exr", "relative_error").has_value());
}

TEST(ErrorSummary, IsTheSameBytesAfterAMerge) {
  testing::TemporaryFolder folder;
  const auto header = testing::some_header(9, 40);
  write_exr(folder / "whole.exr", header, testing::render_nodes({0, 0, 9, 40}, {0, 12}), &kErrorSummary);
  write_exr(folder / "a.exr", header, testing::render_nodes({0, 0, 9, 40}, {0, 5}), &kErrorSummary);
  write_exr(folder / "b.exr", header, testing::render_nodes({0, 0, 9, 40}, {5, 12}));
  const std::vector<fs::path> files{folder / "a.exr", folder / "b.exr"};
  merge_files(files, folder / "merged.exr", {}, &kErrorSummary);
  EXPECT_EQ(bytes_of(folder / "merged.exr"), bytes_of(folder / "whole.exr"));
}

TEST(ErrorSummary, IsNotBelievedWhenAFileIsRead) {
  // A file that claims no error at all is judged by its pixels.
  testing::TemporaryFolder folder;
  const auto header = testing::some_header(9, 40);
  write_exr(folder / "honest.exr", header, testing::render_nodes({0, 0, 9, 40}, {0, 16}), &kErrorSummary);
  static const PictureSummary kLie{[](SampleRange) {
                                     return std::vector<std::string>{"error.relative_error", "error.pixels"};
                                   },
                                   [](const fs::path&, SampleRange) {
                                     return std::vector<float>{0, -1e30f};
                                   }};
  write_exr(folder / "lie.exr", header, testing::render_nodes({0, 0, 9, 40}, {0, 16}), &kLie);
  EXPECT_EQ(error_fields(estimate_error(folder / "lie.exr")), error_fields(estimate_error(folder / "honest.exr")));
  const std::vector<fs::path> files{folder / "lie.exr"};
  merge_files(files, folder / "merged.exr", {}, &kErrorSummary);
  EXPECT_EQ(bytes_of(folder / "merged.exr"), bytes_of(folder / "honest.exr"));
}

}  // namespace
}  // namespace woodcock
