#include "apps/common/proto_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

using testing::HasSubstr;

std::string ErrorOf(const std::string& json) { return ToString(CustomRecordFromJson("soil", 1000, json).error()); }

TEST(ProtoJsonTest, ReadsACustomRecordFromBase64OrText) {
  const auto base64 =
      CustomRecordFromJson("soil", 1000, R"({"payload": "/wAB", "latest_key": "aG9sZQ==", "metadata": "m"})");
  ASSERT_TRUE(base64.has_value()) << ToString(base64.error());
  EXPECT_EQ(base64->custom().data_type(), 1000u);
  EXPECT_EQ(base64->custom().payload(), std::string("\xFF\x00\x01", 3));
  EXPECT_EQ(base64->custom().latest_key(), "hole");
  EXPECT_EQ(base64->custom().metadata(), "m");
  const auto text =
      CustomRecordFromJson("soil", 1000, R"({"payload_text": "/wAB", "latest_key_text": "hole", "data_type": 1000})");
  ASSERT_TRUE(text.has_value()) << ToString(text.error());
  EXPECT_EQ(text->custom().payload(), "/wAB");
  EXPECT_EQ(text->custom().latest_key(), "hole");
  EXPECT_TRUE(CustomRecordFromJson("soil", 1000, "{}").has_value());
}

TEST(ProtoJsonTest, ReadsItsOwnOutput) {
  proto::CustomRecord custom;
  custom.set_data_type(1000);
  custom.set_payload(std::string("\0\xFE", 2));
  custom.set_latest_key("k");
  const auto read = CustomRecordFromJson("soil", 1000, ToJson(custom));
  ASSERT_TRUE(read.has_value()) << ToString(read.error());
  EXPECT_EQ(read->custom().SerializeAsString(), custom.SerializeAsString());
}

TEST(ProtoJsonTest, ReportsErrorsOfACustomRecord) {
  EXPECT_EQ(ErrorOf(""), R"(soil: expected a JSON object such as {"payload_text": "wet"})");
  EXPECT_EQ(ErrorOf("wet"), R"(soil: expected a JSON object such as {"payload_text": "wet"}, got 'wet')");
  EXPECT_EQ(ErrorOf(R"({"paylod": "x"})"),
            R"(soil: unknown field "paylod"; soil has: data_type, latest_key, payload, metadata, payload_text, )"
            "latest_key_text");
  EXPECT_EQ(ErrorOf(R"({"payload_text": 3})"), "payload_text: expected text");
  EXPECT_EQ(ErrorOf(R"({"payload_text": "a", "payload": "YQ=="})"), "payload_text: cannot be combined with payload");
  EXPECT_EQ(ErrorOf(R"({"data_type": 1001})"), "data_type: must be 1000, the id of soil");
}

TEST(ProtoJsonTest, ListsTheFieldsOfABuiltInType) {
  const auto error_of = [](const std::string& type, const std::string& json) {
    return ToString(RecordFromJson(type, json).error());
  };
  EXPECT_EQ(error_of("temperature", R"({"temp": 20})"),
            R"(temperature: unknown field "temp"; temperature has: celsius)");
  EXPECT_EQ(error_of("temperature", "20"),
            R"(temperature: expected a JSON object such as {"celsius": VALUE}, got '20')");
  EXPECT_EQ(error_of("temperatur", "{}"), "temperatur: is not a built-in data type");
  // A field of a nested message. A name in camelCase is known.
  EXPECT_EQ(error_of("pose_graph_edge", R"({"from": {"agentId": 2, "idx": 140}})"),
            R"(pose_graph_edge: unknown field "idx"; from has: agent_id, index)");
  // A field that exists with a wrong value: protobuf's message.
  EXPECT_THAT(error_of("temperature", R"({"celsius": "warm"})"), HasSubstr("celsius"));
}

}  // namespace
}  // namespace moondb
