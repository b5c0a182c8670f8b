#include "apps/common/proto_json.h"

#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>

#include <optional>

namespace moondb {

std::string ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
  return status.ok() ? json : "null";
}

namespace {

// Parses `json` into `message`. Returns kInvalid with `field` and the first line of protobuf's error message, which
// gives the reason.
Result<void> ParseJson(const std::string& json, const std::string& field, google::protobuf::Message* message) {
  if (json.find_first_not_of(" \t\r\n") == std::string::npos) {
    return Fail(ErrorCode::kInvalid, "expected a JSON object", field);
  }
  const auto status = google::protobuf::util::JsonStringToMessage(json, message);
  if (status.ok()) return {};
  const std::string text(status.message());
  return Fail(ErrorCode::kInvalid, text.substr(0, text.find('\n')), field);
}

// Removes the field NAME_text from `object` and returns its value. Returns nothing if the field is absent, and kInvalid
// if the field is not text or `object` also has the field NAME.
Result<std::optional<std::string>> TakeText(const std::string& name, google::protobuf::Struct& object) {
  const auto found = object.fields().find(name + "_text");
  if (found == object.fields().end()) return std::nullopt;
  if (found->second.kind_case() != google::protobuf::Value::kStringValue) {
    return Fail(ErrorCode::kInvalid, "expected text", name + "_text");
  }
  if (object.fields().contains(name)) {
    return Fail(ErrorCode::kInvalid, "is given as " + name + " too", name + "_text");
  }
  std::string text = found->second.string_value();
  object.mutable_fields()->erase(name + "_text");
  return text;
}

}  // namespace

Result<proto::Record> RecordFromJson(const std::string& type, const std::string& json) {
  const google::protobuf::FieldDescriptor* field = proto::Record::descriptor()->FindFieldByName(type);
  if (field == nullptr || field->containing_oneof() == nullptr) {
    return Fail(ErrorCode::kInvalid, "is no data type with a body", type);
  }
  proto::Record record;
  google::protobuf::Message* body = record.GetReflection()->MutableMessage(&record, field);
  if (const Result<void> parsed = ParseJson(json, type, body); !parsed) return tl::unexpected(parsed.error());
  return record;
}

Result<proto::Record> CustomRecordFromJson(const std::string& name, DataType type, const std::string& json) {
  google::protobuf::Struct object;
  if (const Result<void> parsed = ParseJson(json, name, &object); !parsed) return tl::unexpected(parsed.error());
  const auto payload = TakeText("payload", object);
  if (!payload) return tl::unexpected(payload.error());
  const auto latest_key = TakeText("latest_key", object);
  if (!latest_key) return tl::unexpected(latest_key.error());
  proto::Record record;
  proto::CustomRecord& custom = *record.mutable_custom();
  if (const Result<void> parsed = ParseJson(ToJson(object), name, &custom); !parsed) {
    return tl::unexpected(parsed.error());
  }
  if (custom.data_type() != 0 && custom.data_type() != type) {
    return Fail(ErrorCode::kInvalid, name + " has the id " + std::to_string(type), "data_type");
  }
  custom.set_data_type(type);
  if (*payload) custom.set_payload(**payload);
  if (*latest_key) custom.set_latest_key(**latest_key);
  return record;
}

}  // namespace moondb
