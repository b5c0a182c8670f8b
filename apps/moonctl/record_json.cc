#include "apps/moonctl/record_json.h"

#include <google/protobuf/text_format.h>

#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "model/record_key.h"
#include "model/text.h"

namespace moondb {
namespace {

// Writes `bytes` as text, under the key NAME_text, if they are UTF-8. Protobuf's JSON shows bytes only as base64.
void WriteTextOf(const std::string& name, const std::string& bytes, JsonWriter& json) {
  if (!bytes.empty() && IsUtf8(bytes)) json.Key(name + "_text").String(bytes);
}

}  // namespace

void WriteRecord(const proto::StoredRecord& stored, const proto::Record& record, const CustomTypes& custom_types,
                 JsonWriter& json) {
  json.BeginObject().Key("key").String(stored.key().seq() == 0 ? "" : ToString(FromProto(stored.key())));
  json.Key("type").String(DataTypeName(stored.key().data_type(), custom_types));
  json.Key("bytes").Number(static_cast<double>(stored.content().size()));
  json.Key("utc").String(FormatUtc(record.timestamp_ns()));
  if (record.has_custom()) {
    WriteTextOf("latest_key", record.custom().latest_key(), json);
    WriteTextOf("payload", record.custom().payload(), json);
  }
  json.Key("record").Raw(ToJson(record)).EndObject();
}

std::string ValueText(const proto::Record& record) {
  constexpr std::size_t kValueBytesMax = 60;
  const auto& reflection = *record.GetReflection();
  const auto* body = reflection.GetOneofFieldDescriptor(record, record.GetDescriptor()->FindOneofByName("body"));
  if (body == nullptr) return "";
  google::protobuf::TextFormat::Printer printer;
  printer.SetSingleLineMode(true);
  printer.SetTruncateStringFieldLongerThan(kValueBytesMax);
  std::string text;
  printer.PrintToString(reflection.GetMessage(record, body), &text);
  return OneLine(text, kValueBytesMax);
}

}  // namespace moondb
