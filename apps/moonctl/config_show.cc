#include "apps/moonctl/config_show.h"

#include <google/protobuf/descriptor.h>

#include <algorithm>
#include <functional>
#include <map>

#include "model/text.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) quoted += (c == '"' || c == '\\') ? std::string("\\") + c : std::string(1, c);
  return quoted + "\"";
}

// Returns the text of a field that is a single value. Empty: there is no value to show.
std::string ValueText(const Message& message, const FieldDescriptor& field) {
  const auto& reflection = *message.GetReflection();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string text = reflection.GetString(message, &field);
      return text.empty() ? "" : Quoted(text);
    }
    case FieldDescriptor::CPPTYPE_BOOL:
      return reflection.GetBool(message, &field) ? "true" : "false";
    case FieldDescriptor::CPPTYPE_UINT32:
      return std::to_string(reflection.GetUInt32(message, &field));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return FormatDouble(reflection.GetDouble(message, &field));
    case FieldDescriptor::CPPTYPE_ENUM:
      return YamlName(*reflection.GetEnum(message, &field));
    default:
      return "";
  }
}

std::string ListText(const Message& message, const FieldDescriptor& field) {
  const auto& reflection = *message.GetReflection();
  const int count = reflection.FieldSize(message, &field);
  std::string text;
  for (int i = 0; i < count; ++i) {
    const bool is_text = field.cpp_type() == FieldDescriptor::CPPTYPE_STRING;
    text += (i == 0 ? "" : ", ") + (is_text ? Quoted(reflection.GetRepeatedString(message, &field, i))
                                            : FormatDouble(reflection.GetRepeatedDouble(message, &field, i)));
  }
  return count == 0 ? "" : "[" + text + "]";
}

// Writes a configuration as YAML, in the order of its fields. Collects the paths of the fields that have default
// values.
class Writer {
 public:
  explicit Writer(const std::set<std::string>& given) : given_(given) {}

  void Write(const Message& message, const std::string& path, const std::string& indent) {
    const auto& descriptor = *message.GetDescriptor();
    for (int i = 0; i < descriptor.field_count(); ++i) {
      const FieldDescriptor& field = *descriptor.field(i);
      const std::string at = path.empty() ? field.name() : path + "." + field.name();
      if (field.is_map()) {
        WriteMap(message, field, at, indent);
      } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
        WriteParts(message, field, at, indent);
      } else {
        WriteValue(field.is_repeated() ? ListText(message, field) : ValueText(message, field), field.name(), at,
                   indent);
      }
    }
  }

  std::string text;
  std::vector<std::string> defaulted;

 private:
  void WriteValue(const std::string& value, const std::string& name, const std::string& at, const std::string& indent) {
    if (value.empty()) return;
    const bool is_given = given_.contains(at);
    if (!is_given) defaulted.push_back(at);
    text += indent + name + ": " + value + (is_given ? "" : "   # default") + "\n";
  }

  void WriteMap(const Message& message, const FieldDescriptor& field, const std::string& at,
                const std::string& indent) {
    const auto& reflection = *message.GetReflection();
    std::map<std::string, std::string> values;
    for (int i = 0; i < reflection.FieldSize(message, &field); ++i) {
      const Message& entry = reflection.GetRepeatedMessage(message, &field, i);
      const std::string key = entry.GetReflection()->GetString(entry, field.message_type()->map_key());
      values[key] = ValueText(entry, *field.message_type()->map_value());
    }
    if (!values.empty()) text += indent + field.name() + ":\n";
    for (const std::string& key : KeysOf(field)) WriteValue(values[key], key, at + "." + key, indent + "  ");
  }

  void WriteParts(const Message& message, const FieldDescriptor& field, const std::string& at,
                  const std::string& indent) {
    const auto& reflection = *message.GetReflection();
    if (!field.is_repeated()) {
      if (!reflection.HasField(message, &field)) return;
      text += indent + field.name() + ":\n";
      return Write(reflection.GetMessage(message, &field), at, indent + "  ");
    }
    const int count = reflection.FieldSize(message, &field);
    if (count > 0) text += indent + field.name() + ":\n";
    for (int i = 0; i < count; ++i) {
      const std::size_t begin = text.size();
      Write(reflection.GetRepeatedMessage(message, &field, i), at + "[" + std::to_string(i) + "]", indent + "    ");
      text[begin + indent.size() + 2] = '-';
    }
  }

  const std::set<std::string>& given_;
};

Writer Walk(const proto::TeamConfig& team, const std::set<std::string>& given) {
  Writer writer(given);
  writer.Write(team, "", "");
  return writer;
}

}  // namespace

std::set<std::string> GivenFields(const std::string& yaml) {
  proto::TeamConfig raw;
  Places places;
  PlacedErrors errors("");
  ReadYaml(yaml, &raw, &places, &errors);
  // Parsing sorts the custom types by id (runtime/team/team_check.h), so an index in the file differs from the index in
  // the parsed configuration.
  constexpr std::string_view kTypes = "custom_types[";
  std::vector<std::uint32_t> ids;
  for (const proto::CustomType& type : raw.custom_types()) ids.push_back(type.id());
  std::set<std::string> given;
  for (const auto& [path, place] : places) {
    if (!path.starts_with(kTypes)) {
      given.insert(path);
      continue;
    }
    const std::size_t end = path.find(']');
    const auto index = ParseUnsigned(path.substr(kTypes.size(), end - kTypes.size())).value_or(0);
    const auto rank = std::count_if(ids.begin(), ids.end(), [&](std::uint32_t id) { return id < ids[index]; });
    given.insert(std::string(kTypes) + std::to_string(rank) + path.substr(end));
  }
  return given;
}

std::string EffectiveYaml(const proto::TeamConfig& team, const std::set<std::string>& given) {
  return Walk(team, given).text;
}

std::vector<std::string> DefaultedFields(const proto::TeamConfig& team, const std::set<std::string>& given) {
  return Walk(team, given).defaulted;
}

}  // namespace moondb
