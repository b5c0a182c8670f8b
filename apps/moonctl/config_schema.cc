#include "apps/moonctl/config_schema.h"

#include <google/protobuf/descriptor.h>

#include "apps/common/json_writer.h"
#include "proto/team.pb.h"
#include "runtime/team/field_rules.h"

namespace moondb {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;

void WriteChoices(const EnumDescriptor& type, JsonWriter& json) {
  json.Key("enum").BeginArray();
  for (int i = 0; i < type.value_count(); ++i) {
    const std::string name = YamlName(*type.value(i));
    if (name != "unspecified") json.String(name);
  }
  json.EndArray();
}

void WriteMap(const FieldDescriptor& field, JsonWriter& json);

// Writes the schema members that describe one value of the field: its type and its allowed values.
void WriteType(const FieldDescriptor& field, JsonWriter& json) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
      json.Key("$ref").String("#/definitions/" + field.message_type()->name());
      return;
    case FieldDescriptor::CPPTYPE_ENUM:
      return WriteChoices(*field.enum_type(), json);
    case FieldDescriptor::CPPTYPE_BOOL:
      json.Key("type").String("boolean");
      return;
    case FieldDescriptor::CPPTYPE_UINT32:
      json.Key("type").String("integer");
      return;
    case FieldDescriptor::CPPTYPE_DOUBLE:
      json.Key("type").String("number");
      return;
    default:
      json.Key("type").String("string");
  }
}

void WriteRange(const proto::FieldRule& rule, JsonWriter& json) {
  if (!rule.has_low()) return;
  // The rule may be "0, or 1 to 86400", which JSON Schema cannot express compactly. The schema allows 0 to 86400.
  json.Key("minimum").Number(rule.zero().empty() ? rule.low() : 0).Key("maximum").Number(rule.high());
}

void WriteList(const FieldDescriptor& field, JsonWriter& json) {
  const proto::FieldRule& rule = RuleOf(field);
  if (field.cpp_type() == FieldDescriptor::CPPTYPE_STRING) {
    json.Key("type").BeginArray().String("array").String("string").EndArray();  // The parser also accepts one string.
  } else {
    json.Key("type").String("array");
  }
  json.Key("items").BeginObject();
  WriteType(field, json);
  WriteRange(rule, json);
  json.EndObject();
  if (rule.count_min() > 0) json.Key("minItems").Number(rule.count_min());
  if (rule.count_max() > 0) json.Key("maxItems").Number(rule.count_max());
}

void WriteField(const FieldDescriptor& field, JsonWriter& json) {
  const proto::FieldRule& rule = RuleOf(field);
  json.Key(field.name()).BeginObject().Key("description").String(rule.text());
  if (field.is_map()) {
    WriteMap(field, json);
  } else if (field.is_repeated()) {
    WriteList(field, json);
  } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
    // JSON Schema draft 7 ignores members beside "$ref". The reference is therefore put into "allOf".
    json.Key("allOf").BeginArray().BeginObject();
    WriteType(field, json);
    json.EndObject().EndArray();
  } else {
    WriteType(field, json);
    if (!rule.pattern().empty()) json.Key("pattern").String(rule.pattern());
    WriteRange(rule, json);
  }
  json.EndObject();
}

// Begins the schema of an object. The caller adds the properties.
void BeginProperties(JsonWriter& json) {
  json.Key("type").BeginArray().String("object").String("null").EndArray();  // YAML reads "radio:" as null.
  json.Key("additionalProperties").Bool(false).Key("properties").BeginObject();
}

void WriteMap(const FieldDescriptor& field, JsonWriter& json) {
  const proto::FieldRule& rule = RuleOf(field);
  BeginProperties(json);
  for (const std::string& key : KeysOf(field)) {
    json.Key(key).BeginObject().Key("description").String(rule.value_text());
    WriteType(*field.message_type()->map_value(), json);
    if (!rule.pattern().empty()) json.Key("pattern").String(rule.pattern());
    json.EndObject();
  }
  json.EndObject().Key("required").BeginArray().EndArray();
}

void WriteMembers(const Descriptor& type, JsonWriter& json) {
  BeginProperties(json);
  for (int i = 0; i < type.field_count(); ++i) WriteField(*type.field(i), json);
  json.EndObject().Key("required").BeginArray();
  for (int i = 0; i < type.field_count(); ++i) {
    if (RuleOf(*type.field(i)).required()) json.String(type.field(i)->name());
  }
  json.EndArray();
}

}  // namespace

std::string TeamFileSchema() {
  JsonWriter json;
  json.BeginObject().Key("$schema").String("http://json-schema.org/draft-07/schema#");
  json.Key("title").String("Team file of moondb").Key("definitions").BeginObject();
  const Descriptor& team = *proto::TeamConfig::descriptor();
  for (int i = 0; i < team.file()->message_type_count(); ++i) {
    const Descriptor& part = *team.file()->message_type(i);
    if (&part == &team) continue;
    json.Key(part.name()).BeginObject();
    WriteMembers(part, json);
    json.EndObject();
  }
  json.EndObject();
  WriteMembers(team, json);
  return json.EndObject().text();
}

}  // namespace moondb
