// Messages as the database's rows have them, held against protobuf's own conversion.
#include "coordinator/row_json.h"

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/message_differencer.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "woodcock/v1/settings.pb.h"

namespace woodcock::coordinator {
namespace {

using google::protobuf::Message;
using google::protobuf::util::MessageDifferencer;

std::string protobufs(const Message& message) {
  std::string text;
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  EXPECT_TRUE(google::protobuf::util::MessageToJsonString(message, &text, options).ok());
  return text;
}

v1::RenderSettings all_settings() {
  v1::RenderSettings s;
  s.mutable_resolution()->set_width(std::numeric_limits<int32_t>::max());
  s.mutable_crop()->set_x0(-3);
  s.set_samples(std::numeric_limits<int64_t>::max());
  s.set_seed(std::numeric_limits<uint64_t>::max());
  s.set_max_depth(std::numeric_limits<int32_t>::min());
  s.set_estimator("auto");
  s.set_allow_unsupported(true);
  s.set_tile_size(std::numeric_limits<uint32_t>::max());
  s.set_only("absorption,emission");
  s.set_step(0.1);
  s.set_directions(0);  // present, and what it would be without
  s.set_plan_off(true);
  s.set_without("guiding");
  s.add_set("medium.smoke.g=0.8");
  s.add_set("");
  s.add_set("\"quoted\" \\ \t \n \x01 \x7f <tag> & é 漢 \U0001F426");
  return s;
}

std::vector<std::unique_ptr<Message>> messages() {
  std::vector<std::unique_ptr<Message>> all;
  all.push_back(std::make_unique<v1::RenderSettings>());
  all.push_back(std::make_unique<v1::RenderSettings>(all_settings()));
  for (const double step : {1.0, 1e-300, 1e300, 5e-324, 123456789.123456789, 1.0 / 3}) {
    v1::RenderSettings settings;
    settings.set_step(step);
    all.push_back(std::make_unique<v1::RenderSettings>(settings));
  }
  v1::FrameHeader header;
  header.mutable_resolution();
  header.mutable_pixel_bounds()->set_x1(32);
  header.set_scene_digest(std::string(64, 'a'));
  header.set_seed(1);
  header.set_frame(7);
  header.add_settings()->set_key("estimator");
  header.mutable_settings(0)->set_value("auto");
  header.add_settings();
  all.push_back(std::make_unique<v1::FrameHeader>(header));
  return all;
}

TEST(RowJson, SaysWhatProtobufSays) {
  for (const auto& message : messages()) {
    const std::string text = to_row_json(*message);
    EXPECT_EQ(nlohmann::json::parse(text), nlohmann::json::parse(protobufs(*message)));
  }
}

TEST(RowJson, EachReadsWhatTheOtherWrote) {
  for (const auto& message : messages()) {
    const std::unique_ptr<Message> read(message->New());
    from_row_json(to_row_json(*message), *read);
    EXPECT_TRUE(MessageDifferencer::Equals(*message, *read)) << read->DebugString();
    from_row_json(protobufs(*message), *read);
    EXPECT_TRUE(MessageDifferencer::Equals(*message, *read)) << read->DebugString();
    ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(to_row_json(*message), read.get()).ok());
    EXPECT_TRUE(MessageDifferencer::Equals(*message, *read)) << read->DebugString();
  }
}

TEST(RowJson, ReadsOtherSpellingsAndLeavesOutWhatItDoesNotKnow) {
  v1::RenderSettings settings;
  settings.set_estimator("of before");
  from_row_json(R"({"samples": 8, "maxDepth": 3, "fromTheFuture": {"a": [1]}, "seed": "9", "step": "2.5"})", settings);
  EXPECT_EQ(settings.samples(), 8);
  EXPECT_EQ(settings.max_depth(), 3);
  EXPECT_EQ(settings.seed(), 9U);
  EXPECT_EQ(settings.step(), 2.5);
  EXPECT_EQ(settings.estimator(), "");
}

TEST(RowJson, WhatIsMalformedIsAnErrorWithItsText) {
  for (const std::string text :
       {"{", R"({"samples": "eight"})", R"({"max_depth": 3000000000})", R"({"resolution": 3})", R"({"plan_off": "maybe"})"}) {
    v1::RenderSettings settings;
    try {
      from_row_json(text, settings);
      ADD_FAILURE() << text << " was read as " << settings.DebugString();
    } catch (const std::runtime_error& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr("malformed JSON in the database: " + text));
    }
  }
}

}  // namespace
}  // namespace woodcock::coordinator
