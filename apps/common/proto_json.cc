#include "apps/common/proto_json.h"

#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>

#include <optional>
#include <set>

#include "model/text.h"

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

constexpr std::size_t kShownBytesMax = 60;  // Bytes of an input that an error shows.

// Lists the fields of `type`: "celsius, sensor".
std::string FieldNames(const google::protobuf::Descriptor& type) {
  std::string names;
  for (int i = 0; i < type.field_count(); ++i) names += (i == 0 ? "" : ", ") + type.field(i)->name();
  return names;
}

// Returns the field of `type` that JSON calls `name`, as in the .proto file or in camelCase; null if there is none.
const google::protobuf::FieldDescriptor* FieldNamed(const google::protobuf::Descriptor& type, const std::string& name) {
  for (int i = 0; i < type.field_count(); ++i) {
    if (type.field(i)->name() == name || type.field(i)->json_name() == name) return type.field(i);
  }
  return nullptr;
}

// Returns an error text for the first field of `object` that `type` lacks, also within nested messages. `where` is the
// name of the object: "temperature", or "from" for a nested message. `more_fields` extends the list of the object's
// fields. Empty: all fields exist.
std::string UnknownFieldText(const google::protobuf::Descriptor& type, const std::string& where,
                             const std::string& more_fields, const google::protobuf::Struct& object) {
  std::set<std::string> names;  // In alphabetical order, so that the error is the same each time.
  for (const auto& entry : object.fields()) names.insert(entry.first);
  for (const std::string& name : names) {
    const google::protobuf::FieldDescriptor* field = FieldNamed(type, name);
    if (field == nullptr) {
      return "unknown field \"" + OneLine(name) + "\"; " + where + " has: " + FieldNames(type) + more_fields;
    }
    const google::protobuf::Value& value = object.fields().at(name);
    const bool is_message = field->message_type() != nullptr && !field->is_repeated();
    if (!is_message || value.kind_case() != google::protobuf::Value::kStructValue) continue;
    const std::string text = UnknownFieldText(*field->message_type(), field->name(), "", value.struct_value());
    if (!text.empty()) return text;
  }
  return "";
}

// Returns kInvalid for `json` if it is not a JSON object. `example` shows the form of such an object.
Result<void> CheckObject(const std::string& json, const std::string& field, const std::string& example) {
  const std::size_t first = json.find_first_not_of(" \t\r\n");
  if (first != std::string::npos && json[first] == '{') return {};
  const std::string got = first == std::string::npos ? "" : ", got '" + OneLine(json, kShownBytesMax) + "'";
  return Fail(ErrorCode::kInvalid, "expected a JSON object such as " + example + got, field);
}

// Parses the JSON object `json` into `message`. Returns kInvalid with `field` and a text that names an unknown field
// and lists the known ones, followed by `more_fields`. For any other error, the text is the first line of protobuf's
// message.
Result<void> ParseJson(const std::string& json, const std::string& field, const std::string& more_fields,
                       google::protobuf::Message* message) {
  const auto status = google::protobuf::util::JsonStringToMessage(json, message);
  if (status.ok()) return {};
  google::protobuf::Struct object;
  std::string text;
  if (google::protobuf::util::JsonStringToMessage(json, &object).ok()) {
    text = UnknownFieldText(*message->GetDescriptor(), field, more_fields, object);
  }
  if (text.empty()) {
    text = std::string(status.message());
    text = text.substr(0, text.find('\n'));
  }
  return Fail(ErrorCode::kInvalid, text, field);
}

// Returns an object with the first field of `type`: {"celsius": VALUE}.
std::string ExampleOf(const google::protobuf::Descriptor& type) {
  return type.field_count() == 0 ? "{}" : "{\"" + type.field(0)->name() + "\": VALUE}";
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
    return Fail(ErrorCode::kInvalid, "cannot be combined with " + name, name + "_text");
  }
  std::string text = found->second.string_value();
  object.mutable_fields()->erase(name + "_text");
  return text;
}

}  // namespace

Result<proto::Record> RecordFromJson(const std::string& type, const std::string& json) {
  const google::protobuf::FieldDescriptor* field = proto::Record::descriptor()->FindFieldByName(type);
  if (field == nullptr || field->containing_oneof() == nullptr) {
    return Fail(ErrorCode::kInvalid, "is not a built-in data type", type);
  }
  proto::Record record;
  google::protobuf::Message* body = record.GetReflection()->MutableMessage(&record, field);
  const Result<void> checked = CheckObject(json, type, ExampleOf(*body->GetDescriptor()));
  if (!checked) return tl::unexpected(checked.error());
  if (const Result<void> parsed = ParseJson(json, type, "", body); !parsed) return tl::unexpected(parsed.error());
  return record;
}

Result<proto::Record> CustomRecordFromJson(const std::string& name, DataType type, const std::string& json) {
  const Result<void> checked = CheckObject(json, name, R"({"payload_text": "wet"})");
  if (!checked) return tl::unexpected(checked.error());
  google::protobuf::Struct object;
  if (const Result<void> parsed = ParseJson(json, name, "", &object); !parsed) return tl::unexpected(parsed.error());
  const auto payload = TakeText("payload", object);
  if (!payload) return tl::unexpected(payload.error());
  const auto latest_key = TakeText("latest_key", object);
  if (!latest_key) return tl::unexpected(latest_key.error());
  proto::Record record;
  proto::CustomRecord& custom = *record.mutable_custom();
  const Result<void> parsed = ParseJson(ToJson(object), name, ", payload_text, latest_key_text", &custom);
  if (!parsed) return tl::unexpected(parsed.error());
  if (custom.data_type() != 0 && custom.data_type() != type) {
    return Fail(ErrorCode::kInvalid, "must be " + std::to_string(type) + ", the id of " + name, "data_type");
  }
  custom.set_data_type(type);
  if (*payload) custom.set_payload(**payload);
  if (*latest_key) custom.set_latest_key(**latest_key);
  return record;
}

}  // namespace moondb
