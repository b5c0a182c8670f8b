#include "apps/common/json_writer.h"

#include <gtest/gtest.h>

#include <limits>

#include "apps/common/proto_json.h"

namespace moondb {
namespace {

TEST(JsonWriterTest, SeparatesMembersByCommas) {
  JsonWriter json;
  json.BeginObject().Key("a").BeginArray().Number(1).Number(2.5).BeginObject().EndObject().EndArray();
  json.Key("b").Bool(true).Key("c").Null().Key("d").Raw("{\"x\":1}").EndObject();
  EXPECT_EQ(json.text(), R"({"a":[1,2.5,{}],"b":true,"c":null,"d":{"x":1}})");
}

TEST(JsonWriterTest, EscapesSpecialCharacters) {
  JsonWriter json;
  json.String("quote \" back \\ line \n bell \x07 moon \xF0\x9F\x8C\x99");
  EXPECT_EQ(json.text(), "\"quote \\\" back \\\\ line \\u000a bell \\u0007 moon \xF0\x9F\x8C\x99\"");
}

TEST(JsonWriterTest, ReplacesInvalidUtf8) {
  JsonWriter json;
  json.String("a\xFF\xC3 b\xED\xA0\x80\xC0\xAF\xE2\x82");
  const std::string bad = "\xEF\xBF\xBD";
  EXPECT_EQ(json.text(), "\"a" + bad + bad + " b" + bad + bad + bad + bad + bad + bad + bad + "\"");
}

TEST(JsonWriterTest, WritesNullForNonFiniteNumbers) {
  JsonWriter json;
  json.Number(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(json.text(), "null");
}

TEST(ProtoJsonTest, KeepsFieldNamesAndDefaults) {
  proto::Power power;
  EXPECT_EQ(ToJson(power), R"({"draw_w":0})");
}

TEST(ProtoJsonTest, ReadsARecordByItsType) {
  const auto record = RecordFromJson("temperature", R"({"celsius": -20.5})");
  ASSERT_TRUE(record.has_value()) << ToString(record.error());
  EXPECT_EQ(record->temperature().celsius(), -20.5);
}

TEST(ProtoJsonTest, NamesTheFieldThatIsWrong) {
  const auto unknown = RecordFromJson("temperature", R"({"celsiu": 1})");
  ASSERT_FALSE(unknown.has_value());
  EXPECT_EQ(unknown.error().code, ErrorCode::kInvalid);
  EXPECT_NE(unknown.error().text.find("celsiu"), std::string::npos);
  EXPECT_FALSE(RecordFromJson("temperature", "").has_value());
  EXPECT_FALSE(RecordFromJson("temperature", "null").has_value());
  EXPECT_FALSE(RecordFromJson("temperature", "{").has_value());
}

TEST(ProtoJsonTest, AcceptsOnlyABody) {
  EXPECT_FALSE(RecordFromJson("temperature", R"({"celsius": 1}, "timestamp_ns": "5")").has_value());
  EXPECT_FALSE(RecordFromJson("timestamp_ns", "5").has_value());
  EXPECT_FALSE(RecordFromJson("temperatur", "{}").has_value());
  const std::string text = RecordFromJson("temperature", R"({"celsius": NaN})").error().text;
  EXPECT_EQ(text.find('\n'), std::string::npos) << text;
}

TEST(JsonWriterTest, WritesNotesAsOneObject) {
  JsonWriter json;
  json.BeginObject().Key("notes").WriteNotes({{"agent", "rover1"}, {"maps", "3"}}).Key("a").Number(1).EndObject();
  EXPECT_EQ(json.text(), R"({"notes":{"agent":"rover1","maps":"3"},"a":1})");
}

}  // namespace
}  // namespace moondb
