// The files of a render: a picture that the simplest reader opens, the nodes beside it, and what is said where one of them is lost.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "renderer/film/exr.h"
#include "tests/film/small_readers.h"
#include "tests/support/frame_bytes.h"
#include "tests/support/run_command.h"

namespace woodcock::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class PictureFiles : public ::testing::Test {
 protected:
  CommandResult woodcock(std::vector<std::string> words) const {
    words.insert(words.begin(), WOODCOCK_BIN_DIR "/woodcock");
    return run_command(words, folder_.path());
  }
  CommandResult render(const std::string& name, const std::vector<std::string>& options) const {
    std::vector<std::string> words{"render", WOODCOCK_SOURCE_DIR "/scenes/cornell.pbrt", "-o", name};
    words.insert(words.end(), options.begin(), options.end());
    if (std::find(options.begin(), options.end(), "--resolution") == options.end()) words.insert(words.end(), {"--resolution", "48x40"});
    return woodcock(words);
  }
  std::string rendered(const std::string& name, const std::vector<std::string>& options) const {
    const CommandResult result = render(name, options);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return bytes_of_frame(folder_ / name);
  }
  /// tinyexr's simplest call finds the means of the nodes' fold, in a picture of this size.
  void expect_colours(const std::string& name, int width, int height) const {
    ExrReader nodes(nodes_beside(folder_ / name));
    const PixelRect rect = nodes.info().rect;
    const auto rows = nodes.beauty_rows(rect.y0, rect.y1);
    EXPECT_TRUE(read_header(folder_ / name).plain());
    const SmallPicture picture = load_exr(folder_ / name);
    ASSERT_EQ(picture.width, width);
    ASSERT_EQ(picture.height, height);
    ASSERT_EQ(rows.size(), static_cast<size_t>(width) * static_cast<size_t>(height));
    int coloured = 0;
    for (size_t p = 0; p < rows.size(); ++p) {
      for (size_t c = 0; c < 3; ++c) ASSERT_EQ(picture.rgba[4 * p + c], rows[p].mean[static_cast<int>(c)]) << "pixel " << p;
      coloured += rows[p].mean.r != rows[p].mean.b;
    }
    EXPECT_GT(coloured, 100) << "the scene has colours that could be confused";
  }

  TemporaryFolder folder_;
};

TEST_F(PictureFiles, AreRightInASmallReaderAtAnyCountWithATargetAndOfACrop) {
  for (const char* samples : {"16", "24"}) {
    rendered("a.exr", {"--spp", samples});
    expect_colours("a.exr", 48, 40);
    rendered("crop.exr", {"--spp", samples, "--crop", "5,45,3,33"});
    expect_colours("crop.exr", 40, 30);
  }
  rendered("target.exr", {"--target-error", "30%", "--resolution", "96x80"});
  expect_colours("target.exr", 96, 80);
  rendered("part.exr", {"--samples", "5:16"});
  expect_colours("part.exr", 48, 40);
  ASSERT_EQ(render("front.exr", {"--samples", "0:5"}).exit_code, 0);
  ASSERT_EQ(woodcock({"merge", "part.exr", "front.exr", "-o", "merged.exr"}).exit_code, 0);
  expect_colours("merged.exr", 48, 40);
}

TEST_F(PictureFiles, OfAMergeAreThoseOfTheRenderAlsoWhereAPatternNamesPicturesAndNodes) {
  const std::string whole = rendered("whole.exr", {"--spp", "12"});
  rendered("a.exr", {"--samples", "0:5"});
  rendered("b.exr", {"--samples", "5:12"});
  const CommandResult merged = woodcock({"merge", "a.exr", "a.nodes.exr", "b.exr", "b.nodes.exr", "-o", "merged.exr"});
  EXPECT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_EQ(bytes_of_frame(folder_ / "merged.exr"), whole);
  // The nodes alone will do, too.
  ASSERT_EQ(woodcock({"merge", "a.nodes.exr", "b.nodes.exr", "-o", "merged.exr"}).exit_code, 0);
  EXPECT_EQ(bytes_of_frame(folder_ / "merged.exr"), whole);
}

TEST_F(PictureFiles, OfEarlierVersionsAreResumedAndMerged) {
  const std::string whole = rendered("whole.exr", {"--spp", "12"});
  // What is now the nodes' file was the picture.
  for (const char* samples : {"4", "3"}) {
    rendered("new.exr", {"--spp", samples});
    fs::copy_file(folder_ / "new.nodes.exr", folder_ / "old.exr", fs::copy_options::overwrite_existing);
    fs::remove(folder_ / "old.nodes.exr");
    EXPECT_EQ(rendered("old.exr", {"--spp", "12", "--resume"}), whole) << samples;
    fs::copy_file(folder_ / "new.nodes.exr", folder_ / "old.exr", fs::copy_options::overwrite_existing);
    ASSERT_EQ(woodcock({"merge", "old.exr", "-o", "merged.exr"}).exit_code, 0);
    EXPECT_EQ(bytes_of_frame(folder_ / "merged.exr"), bytes_of_frame(folder_ / "new.exr"));
  }
}

TEST_F(PictureFiles, AreResumedFromTheNodesWhereThePictureIsLost) {
  const std::string whole = rendered("a.exr", {"--spp", "12"});
  rendered("b.exr", {"--spp", "5"});
  fs::remove(folder_ / "b.exr");
  EXPECT_EQ(rendered("b.exr", {"--spp", "12", "--resume"}), whole);
}

TEST_F(PictureFiles, ThatDoNotBelongTogetherAreRefusedWithWhatToDo) {
  const std::string right = rendered("a.exr", {"--spp", "4"}), more = rendered("b.exr", {"--spp", "6"});
  const auto refused = [&](const CommandResult& result, const std::vector<std::string>& words) {
    EXPECT_EQ(result.exit_code, 1) << result.out;
    for (const std::string& word : words) EXPECT_THAT(result.err, HasSubstr(word));
  };
  // The state between the renames of `b` over `a`.
  fs::copy_file(folder_ / "b.nodes.exr", folder_ / "a.nodes.exr", fs::copy_options::overwrite_existing);
  const std::vector<std::string> other{"a.nodes.exr", "does not belong to a.exr", "woodcock merge a.nodes.exr -o a.exr"};
  refused(render("a.exr", {"--spp", "12", "--resume"}), other);
  refused(render("a.exr", {"--target-error", "20%", "--resume"}), other);
  refused(woodcock({"merge", "a.exr", "-o", "c.exr"}), other);
  refused(woodcock({"compare", "a.exr", "b.exr"}), other);
  EXPECT_FALSE(fs::exists(folder_ / "c.exr"));
  // What the message says to do.
  ASSERT_EQ(woodcock({"merge", "a.nodes.exr", "-o", "a.exr"}).exit_code, 0);
  EXPECT_EQ(bytes_of_frame(folder_ / "a.exr"), more);

  fs::remove(folder_ / "a.nodes.exr");
  const std::vector<std::string> lost{"a.exr", "a.nodes.exr", "put that file back"};
  refused(render("a.exr", {"--spp", "12", "--resume"}), lost);
  refused(woodcock({"merge", "a.exr", "-o", "c.exr"}), lost);
}

TEST_F(PictureFiles, AreComparedWithTheirNoiseOrItIsSaidThatItIsUnknown) {
  rendered("a.exr", {"--spp", "16"});
  rendered("r.exr", {"--spp", "32", "--seed", "7"});
  EXPECT_THAT(woodcock({"compare", "a.exr", "r.exr"}).out, HasSubstr("both pictures carry their statistics"));
  fs::rename(folder_ / "r.nodes.exr", folder_ / "elsewhere.nodes.exr");
  const CommandResult reference = woodcock({"compare", "a.exr", "r.exr"});
  EXPECT_EQ(reference.exit_code, 0) << reference.err;
  EXPECT_THAT(reference.out, HasSubstr("caution: the reference has noise that nothing tells"));
  const CommandResult picture = woodcock({"compare", "r.exr", "a.exr"});
  EXPECT_EQ(picture.exit_code, 0) << picture.err;
  EXPECT_THAT(picture.out, AllOf(HasSubstr("cannot be told"), HasSubstr("r.nodes.exr")));
}

TEST_F(PictureFiles, APictureAloneIsASampleMap) {
  const std::string whole = rendered("a.exr", {"--target-error", "30%"});
  fs::create_directory(folder_ / "sent");
  fs::copy_file(folder_ / "a.exr", folder_ / "sent/a.exr");
  EXPECT_EQ(rendered("again.exr", {"--sample-map", "sent/a.exr"}), whole);
}

TEST_F(PictureFiles, OfASweepArePicturesWithTheirNodes) {
  const CommandResult result =
      woodcock({"sweep", WOODCOCK_SOURCE_DIR "/scenes/fog.pbrt", "--resolution", "16x9", "--spp", "1,3", "--seeds", "2", "-o", "s"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  int pictures = 0;
  for (const auto& entry : fs::directory_iterator(folder_ / "s/pictures")) {
    const std::string name = entry.path().filename();
    if (name.ends_with(".nodes.exr")) {
      EXPECT_TRUE(fs::exists(entry.path().parent_path() / (name.substr(0, name.size() - 10) + ".exr"))) << name;
      continue;
    }
    ++pictures;
    EXPECT_EQ(load_exr(entry.path()).width, 16);
    EXPECT_EQ(woodcock({"merge", entry.path(), "-o", "same.exr"}).exit_code, 0) << name;
  }
  EXPECT_GE(pictures, 3);
}

}  // namespace
}  // namespace woodcock::testing
