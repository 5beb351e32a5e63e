// The frames of a sequence as farms write them.
#include "client/frame_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace woodcock {
namespace {

using ::testing::HasSubstr;
using Frames = std::vector<uint64_t>;

std::string error_of(const std::string& text) {
  try {
    parse_frame_list(text);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(FrameList, ReadsFramesRangesAndStepsInTheirOrder) {
  EXPECT_EQ(parse_frame_list("7").frames, (Frames{7}));
  EXPECT_EQ(parse_frame_list("1-4").frames, (Frames{1, 2, 3, 4}));
  EXPECT_EQ(parse_frame_list("5-5").frames, (Frames{5}));
  EXPECT_EQ(parse_frame_list("1-10x5,200").frames, (Frames{1, 6, 200})) << "a last step that does not fit is none";
  EXPECT_EQ(parse_frame_list("0-8x4").frames, (Frames{0, 4, 8}));
  EXPECT_EQ(parse_frame_list("100,1-3").frames, (Frames{100, 1, 2, 3})) << "what comes first is rendered first";
  EXPECT_EQ(parse_frame_list("1-3x18446744073709551615").frames, (Frames{1}));
  EXPECT_EQ(parse_frame_list("18446744073709551614-18446744073709551615").frames, (Frames{18446744073709551614u, 18446744073709551615u}));
}

TEST(FrameList, TellsWhichFramesAreNamedTwiceAndKeepsEachOnce) {
  const FrameList list = parse_frame_list("1-10x3,4,8-10,10");
  EXPECT_EQ(list.frames, (Frames{1, 4, 7, 10, 8, 9}));
  EXPECT_EQ(list.repeated, (Frames{4, 10}));
  EXPECT_TRUE(parse_frame_list("1-3,4-6").repeated.empty());
}

TEST(FrameList, SaysAtWhichCharacterItIsWrong) {
  const auto says = [](const std::string& text, const std::string& found, int character) {
    const std::string error = error_of(text);
    EXPECT_THAT(error, HasSubstr("found " + found + " at character " + std::to_string(character) + " of")) << text;
    EXPECT_THAT(error, HasSubstr(", expected ")) << text;
  };
  says("", "the end", 1);
  says("a", "\"a\"", 1);
  says("-5", "\"-5\"", 1);
  says("1-", "the end", 3);
  says("1-100y5", "\"y5\"", 6);
  says("1-100x", "the end", 7);
  says("1-100x0,200", "\"0,200\"", 7);
  says("1-100x5,", "the end", 9);
  says(",3", "\",3\"", 1);
  says("1,,3", "\",3\"", 3);
  says("1, 3", "\" 3\"", 3);
  says("9-3", "\"3\"", 3);
  says("1-2-3", "\"-3\"", 4);
  says("5x2", "\"x2\"", 2);
  says("1.5", "\".5\"", 2);
  says("1-18446744073709551616", "\"18446744073709551616\"", 3);
  says("7,1-10001", "\"1-10001\"", 3);
}

TEST(FrameList, HoldsTenThousandFramesAndNotOneMore) {
  EXPECT_EQ(parse_frame_list("1-10000").frames.size(), 10'000u);
  EXPECT_EQ(parse_frame_list("0-49995x5").frames.size(), 10'000u);
  for (const std::string text : {"1-10001", "0-50000x5", "1-10000,20000", "0-18446744073709551615", "1-9999,1-2"})
    EXPECT_THAT(error_of(text), HasSubstr("at most 10000 frames")) << text;
}

TEST(FrameList, EscapesWhatATerminalWouldObey) { EXPECT_THAT(error_of("1-\x1b[2J"), ::testing::Not(HasSubstr("\x1b"))); }

TEST(FrameList, IsDescribedInRanges) {
  EXPECT_EQ(describe_frames({7}), "7");
  EXPECT_EQ(describe_frames({9, 1, 2, 3, 7}), "1-3, 7, 9");
  EXPECT_EQ(describe_frames({1, 3, 5, 7}, 2), "1, 3, …");
}

}  // namespace
}  // namespace woodcock
