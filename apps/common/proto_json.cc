#include "apps/common/proto_json.h"

#include <google/protobuf/util/json_util.h>

namespace moondb {

std::string ToJson(const google::protobuf::Message& message) {
  google::protobuf::util::JsonPrintOptions options;
  options.always_print_primitive_fields = true;
  options.preserve_proto_field_names = true;
  std::string json;
  const auto status = google::protobuf::util::MessageToJsonString(message, &json, options);
  return status.ok() ? json : "null";
}

Result<proto::Record> RecordFromJson(const std::string& type, const std::string& json) {
  const google::protobuf::FieldDescriptor* field = proto::Record::descriptor()->FindFieldByName(type);
  if (field == nullptr || field->containing_oneof() == nullptr) {
    return Fail(ErrorCode::kInvalid, "is no data type with a body", type);
  }
  proto::Record record;
  google::protobuf::Message* body = record.GetReflection()->MutableMessage(&record, field);
  if (json.find_first_not_of(" \t\r\n") == std::string::npos) {
    return Fail(ErrorCode::kInvalid, "expected a JSON object", type);
  }
  const auto status = google::protobuf::util::JsonStringToMessage(json, body);
  if (!status.ok()) {
    // The first line says what; the others show where, in the text as it was read.
    const std::string message(status.message());
    return Fail(ErrorCode::kInvalid, message.substr(0, message.find('\n')), type);
  }
  return record;
}

}  // namespace moondb
