#include "runtime/team/yaml_reader.h"

#include <google/protobuf/descriptor.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "model/check.h"
#include "model/did_you_mean.h"
#include "proto/field_options.pb.h"

namespace moondb {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::EnumValueDescriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

// Maximum number of elements per list. Without it, YAML aliases in a small file could repeat one long list many times.
constexpr std::size_t kElementsMax = 256;

Place ToPlace(const YAML::Mark& mark) { return {std::max(mark.line, 0) + 1, std::max(mark.column, 0) + 1}; }

std::string LowerCase(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return std::tolower(c); });
  return text;
}

// Returns the prefix of an enumeration's values: "AgentKind" -> "agent_kind_".
std::string PrefixOf(const EnumDescriptor& type) {
  std::string prefix;
  for (const char c : type.name()) {
    if (std::isupper(static_cast<unsigned char>(c)) && !prefix.empty()) prefix += '_';
    prefix += c;
  }
  return LowerCase(prefix) + "_";
}

std::vector<const EnumValueDescriptor*> WritableValues(const EnumDescriptor& type) {
  std::vector<const EnumValueDescriptor*> values;
  for (int i = 0; i < type.value_count(); ++i) {
    if (YamlName(*type.value(i)) != "unspecified") values.push_back(type.value(i));
  }
  return values;
}

std::string Enumerate(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (i > 0) text += i + 1 == words.size() ? " or " : ", ";
    text += words[i];
  }
  return text;
}

std::string Describe(const YAML::Node& node) {
  if (node.IsNull()) return "nothing";
  if (node.IsSequence()) return "a list";
  if (node.IsMap()) return "fields";
  return Quoted(node.Scalar());
}

bool IsPlainText(const std::string& text) {
  return std::all_of(text.begin(), text.end(), [](char c) { return c >= 0x20 && c < 0x7f; });
}

// Parses the whole text as a decimal number without a plus sign or spaces. If this fails, returns nothing and sets
// `code`.
template <typename T>
std::optional<T> ToNumber(const std::string& text, std::errc* code) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  *code = error;
  if (end != text.data() + text.size()) *code = std::errc::invalid_argument;
  if (*code != std::errc()) return std::nullopt;
  return value;
}

// Reads one document into a message. A Reader can be used only once.
class Reader {
 public:
  Reader(Places* places, PlacedErrors* errors) : places_(*places), errors_(*errors) {}

  void ReadMessage(const YAML::Node& node, Place place, const std::string& path, Message* message) {
    std::vector<std::string> names;
    const Descriptor& type = *message->GetDescriptor();
    for (int i = 0; i < type.field_count(); ++i) names.push_back(type.field(i)->name());
    ReadEntries(node, place, path, names,
                [&](const std::string& name, const YAML::Node& value, Place value_place, const std::string& at) {
                  ReadField(value, value_place, at, *type.FindFieldByName(name), message);
                });
  }

  void ReadField(const YAML::Node& node, Place place, const std::string& path, const FieldDescriptor& field,
                 Message* message) {
    if (field.is_map()) return ReadMap(node, place, path, field, message);
    const bool is_one_word = field.cpp_type() == FieldDescriptor::CPPTYPE_STRING && node.IsScalar();
    if (!field.is_repeated() || is_one_word) return ReadValue(node, place, path, field, message);
    if (!node.IsSequence()) return errors_.Add(place, path, "expected a list, got " + Describe(node));
    if (node.size() > kElementsMax) {
      return errors_.Add(
          place, path,
          "at most " + std::to_string(kElementsMax) + " elements are allowed, got " + std::to_string(node.size()));
    }
    for (std::size_t i = 0; i < node.size(); ++i) {
      const std::string element_path = path + "[" + std::to_string(i) + "]";
      const Place element_place = node[i].IsNull() ? place : ToPlace(node[i].Mark());
      places_[element_path] = element_place;
      ReadValue(node[i], element_place, element_path, field, message);
    }
  }

 private:
  static std::string Join(const std::string& path, const std::string& key) {
    return path.empty() ? key : path + "." + key;
  }

  using ReadEntry =
      std::function<void(const std::string& key, const YAML::Node& value, Place place, const std::string& path)>;

  // Calls `read` for each entry of `node` whose key is one of `names`, including entries without a value. Adds errors
  // for other entries.
  void ReadEntries(const YAML::Node& node, Place place, const std::string& path, const std::vector<std::string>& names,
                   const ReadEntry& read) {
    if (node.IsNull()) return;  // A section such as "radio:" with all its fields commented out.
    if (!node.IsMap()) {
      return errors_.Add(place, path, "expected fields such as \"" + names[0] + ": ...\", got " + Describe(node));
    }
    std::map<std::string, Place> seen;
    for (const auto& entry : node) {
      const Place key_place = ToPlace(entry.first.Mark());
      if (!entry.first.IsScalar()) {
        errors_.Add(key_place, path, "expected a field's name, got " + Describe(entry.first));
        continue;
      }
      const std::string& key = entry.first.Scalar();
      if (std::find(names.begin(), names.end(), key) == names.end()) {
        AddUnknown(names, key, key_place, path);
        continue;
      }
      const std::string field_path = Join(path, key);
      if (const auto [first, is_new] = seen.emplace(key, key_place); !is_new) {
        errors_.Add(key_place, field_path, "given twice, first in line " + std::to_string(first->second.line));
        continue;
      }
      // yaml-cpp gives no exact place for a missing value. Use the place of its key.
      const Place value_place = entry.second.IsNull() ? key_place : ToPlace(entry.second.Mark());
      places_[field_path] = value_place;
      read(key, entry.second, value_place, field_path);
    }
  }

  void AddUnknown(const std::vector<std::string>& names, const std::string& key, Place place, const std::string& path) {
    const std::string quoted = Quoted(key);
    // Remove the quotation marks. The remaining text is escaped and safe to print.
    errors_.Add(place, Join(path, quoted.substr(1, quoted.size() - 2)), "no such field" + DidYouMean(key, names));
    // Mute the field that was probably meant: its absence is a consequence of this error.
    if (const auto meant = ClosestWord(key, names)) errors_.Mute(Join(path, *meant));
  }

  void ReadMap(const YAML::Node& node, Place place, const std::string& path, const FieldDescriptor& field,
               Message* message) {
    ReadEntries(node, place, path, KeysOf(field),
                [&](const std::string& key, const YAML::Node& value, Place value_place, const std::string& at) {
                  Message* entry = message->GetReflection()->AddMessage(message, &field);
                  entry->GetReflection()->SetString(entry, field.message_type()->map_key(), key);
                  ReadValue(value, value_place, at, *field.message_type()->map_value(), entry);
                });
  }

  // Reads one value into `field` of `message`. Appends the value if `field` is repeated.
  void ReadValue(const YAML::Node& node, Place place, const std::string& path, const FieldDescriptor& field,
                 Message* message) {
    const auto* reflection = message->GetReflection();
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      Message* part =
          field.is_repeated() ? reflection->AddMessage(message, &field) : reflection->MutableMessage(message, &field);
      return ReadMessage(node, place, path, part);
    }
    const auto expected = [&](const std::string& what) {
      errors_.Add(place, path, "expected " + what + ", got " + Describe(node));
    };
    const std::string text = node.IsScalar() ? node.Scalar() : "";
    std::errc code{};
    switch (field.cpp_type()) {
      case FieldDescriptor::CPPTYPE_STRING:
        if (!node.IsScalar() || text.empty()) return expected("text");
        if (!IsPlainText(text)) return expected("text of plain ASCII characters");
        if (field.is_repeated()) return reflection->AddString(message, &field, text);
        return reflection->SetString(message, &field, text);
      case FieldDescriptor::CPPTYPE_BOOL:
        if (text != "true" && text != "false") return expected("true or false");
        return reflection->SetBool(message, &field, text == "true");
      case FieldDescriptor::CPPTYPE_UINT32: {
        const auto value = ToNumber<std::uint32_t>(text, &code);
        if (value) return reflection->SetUInt32(message, &field, *value);
        // Report an integer that exceeds uint32 as out of range, not as malformed.
        return expected(code == std::errc::result_out_of_range || ToNumber<std::int64_t>(text, &code)
                            ? "an integer from 0 to 4294967295"
                            : "an integer");
      }
      case FieldDescriptor::CPPTYPE_DOUBLE: {
        const auto value = ToNumber<double>(text, &code);
        const bool is_yaml_infinity = text == ".inf" || text == "-.inf" || text == ".nan";
        if (code == std::errc::result_out_of_range || is_yaml_infinity || (value && !std::isfinite(*value))) {
          return expected("a finite number");
        }
        if (!value) return expected("a number");
        if (field.is_repeated()) return reflection->AddDouble(message, &field, *value);
        return reflection->SetDouble(message, &field, *value);
      }
      case FieldDescriptor::CPPTYPE_ENUM:
        return ReadEnum(node, place, path, field, message);
      default:
        Check(false, "a type of field that the reader supports");
    }
  }

  void ReadEnum(const YAML::Node& node, Place place, const std::string& path, const FieldDescriptor& field,
                Message* message) {
    std::vector<std::string> names;
    for (const EnumValueDescriptor* value : WritableValues(*field.enum_type())) {
      names.push_back(YamlName(*value));
      if (node.IsScalar() && node.Scalar() == names.back()) {
        return message->GetReflection()->SetEnum(message, &field, value);
      }
    }
    const std::string hint = node.IsScalar() ? DidYouMean(node.Scalar(), names) : "";
    errors_.Add(place, path, "expected " + Enumerate(names) + ", got " + Describe(node) + hint);
  }

  Places& places_;
  PlacedErrors& errors_;
};

}  // namespace

Place PlaceOf(const Places& places, std::string field) {
  while (!field.empty()) {
    if (const auto at = places.find(field); at != places.end()) return at->second;
    const std::size_t end = field.find_last_of(".[");
    field.resize(end == std::string::npos ? 0 : end);
  }
  return {};
}

std::vector<std::string> KeysOf(const FieldDescriptor& map) {
  const std::string& name = map.options().GetExtension(proto::rule).keys();
  const EnumDescriptor* type = map.file()->pool()->FindEnumTypeByName(name);
  Check(type != nullptr, "a map of a file names the enumeration of its keys");
  std::vector<std::string> keys;
  for (const EnumValueDescriptor* value : WritableValues(*type)) keys.push_back(YamlName(*value));
  return keys;
}

void ReadYamlField(const std::string& yaml, const FieldDescriptor& field, Message* message) {
  Places places;
  PlacedErrors errors(field.full_name());
  Reader(&places, &errors).ReadField(YAML::Load(yaml), {}, field.name(), field, message);
  Check(errors.empty(), "a field's default can be read");
}

void ReadYaml(const std::string& yaml, Message* message, Places* places, PlacedErrors* errors) {
  try {
    const std::vector<YAML::Node> documents = YAML::LoadAll(yaml);
    if (documents.empty()) return errors->Add({}, "", "the file is empty");
    if (documents.size() > 1) {
      return errors->Add(ToPlace(documents[1].Mark()), "", "a second document begins here; only one is allowed");
    }
    if (!documents[0].IsMap()) {
      return errors->Add(ToPlace(documents[0].Mark()), "",
                         "expected fields such as \"team: NAME\", got " + Describe(documents[0]));
    }
    Reader(places, errors).ReadMessage(documents[0], ToPlace(documents[0].Mark()), "", message);
  } catch (const YAML::Exception& error) {
    errors->Add(ToPlace(error.mark), "", "not YAML: " + error.msg);
  }
}

std::string YamlName(const EnumValueDescriptor& value) {
  const std::string prefix = PrefixOf(*value.type());
  const std::string name = LowerCase(value.name());
  return name.compare(0, prefix.size(), prefix) == 0 ? name.substr(prefix.size()) : name;
}

}  // namespace moondb
