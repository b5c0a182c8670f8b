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
  proto::Record record;
  // The type is one of the record's own field names; what stands behind a complete value would not parse.
  const auto status = google::protobuf::util::JsonStringToMessage("{\"" + type + "\":" + json + "}", &record);
  if (!status.ok()) return Fail(ErrorCode::kInvalid, std::string(status.message()), type);
  if (record.body_case() == proto::Record::BODY_NOT_SET) {
    return Fail(ErrorCode::kInvalid, "expected a JSON object", type);
  }
  return record;
}

}  // namespace moondb
