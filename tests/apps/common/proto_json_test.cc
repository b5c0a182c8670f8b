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
  EXPECT_EQ(ErrorOf(""), "soil: expected a JSON object");
  EXPECT_THAT(ErrorOf("wet"), HasSubstr("soil: "));
  EXPECT_THAT(ErrorOf(R"({"paylod": "x"})"), HasSubstr("paylod"));
  EXPECT_EQ(ErrorOf(R"({"payload_text": 3})"), "payload_text: expected text");
  EXPECT_EQ(ErrorOf(R"({"payload_text": "a", "payload": "YQ=="})"), "payload_text: is given as payload too");
  EXPECT_EQ(ErrorOf(R"({"data_type": 1001})"), "data_type: soil has the id 1000");
}

}  // namespace
}  // namespace moondb
