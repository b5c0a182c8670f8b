#include "runtime/team/field_rules.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/util/message_differencer.h>

#include <cstdio>
#include <memory>
#include <vector>

namespace moondb {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::util::MessageDifferencer;

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.12g", value);
  return text;
}

std::string PathOf(const std::string& path, const FieldDescriptor& field) {
  return path.empty() ? field.name() : path + "." + field.name();
}

std::string ElementPath(const std::string& list, int index) { return list + "[" + std::to_string(index) + "]"; }

bool IsMessage(const FieldDescriptor& field) { return field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE; }

std::vector<const FieldDescriptor*> FieldsOf(const Message& message) {
  std::vector<const FieldDescriptor*> fields;
  const Descriptor& type = *message.GetDescriptor();
  for (int i = 0; i < type.field_count(); ++i) fields.push_back(type.field(i));
  return fields;
}

class RuleChecker {
 public:
  RuleChecker(const Places& places, PlacedErrors* errors) : places_(places), errors_(*errors) {}

  void CheckMessage(const Message& message, const std::string& path) {
    for (const FieldDescriptor* field : FieldsOf(message)) {
      const std::string at = PathOf(path, *field);
      const proto::FieldRule& rule = RuleOf(*field);
      if (places_.count(at) > 0) {
        CheckField(message, *field, at);
      } else if (rule.required()) {
        Add(at, "missing" + (rule.if_missing().empty() ? "" : ": " + rule.if_missing()));
      }
    }
  }

 private:
  void Add(const std::string& at, const std::string& text) { errors_.Add(PlaceOf(places_, at), at, text); }

  void CheckField(const Message& message, const FieldDescriptor& field, const std::string& at) {
    const auto& reflection = *message.GetReflection();
    if (field.is_map()) return;
    if (field.is_repeated()) return CheckList(message, field, at);
    if (IsMessage(field)) return CheckMessage(reflection.GetMessage(message, &field), at);
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE) {
      CheckNumber(reflection.GetDouble(message, &field), RuleOf(field), at);
    } else if (field.cpp_type() == FieldDescriptor::CPPTYPE_UINT32) {
      CheckNumber(reflection.GetUInt32(message, &field), RuleOf(field), at);
    }
  }

  void CheckList(const Message& message, const FieldDescriptor& field, const std::string& at) {
    const auto& reflection = *message.GetReflection();
    const proto::FieldRule& rule = RuleOf(field);
    const int count = reflection.FieldSize(message, &field);
    const bool is_of_numbers = field.cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE;
    if (is_of_numbers && count != static_cast<int>(rule.count_max())) {
      if (errors_.Has(at)) return;
      return Add(at, "expected " + std::to_string(rule.count_max()) + " numbers (" + rule.elements() + "), got " +
                         std::to_string(count));
    }
    if (rule.count_max() > 0 && count > static_cast<int>(rule.count_max())) {
      Add(at, "at most " + std::to_string(rule.count_max()) + " are allowed, got " + std::to_string(count));
    }
    for (int i = 0; i < count; ++i) {
      if (is_of_numbers) CheckNumber(reflection.GetRepeatedDouble(message, &field, i), rule, ElementPath(at, i));
      if (IsMessage(field)) CheckMessage(reflection.GetRepeatedMessage(message, &field, i), ElementPath(at, i));
    }
  }

  void CheckNumber(double value, const proto::FieldRule& rule, const std::string& at) {
    if (!rule.has_low() || (value >= rule.low() && value <= rule.high())) return;
    if (!rule.zero().empty() && value == 0) return;
    Add(at, "expected " + (rule.zero().empty() ? "" : "0, for " + rule.zero() + ", or ") + Number(rule.low()) + " to " +
                Number(rule.high()) + ", got " + Number(value));
  }

  const Places& places_;
  PlacedErrors& errors_;
};

bool HasDefaults(const Descriptor& type) {
  for (int i = 0; i < type.field_count(); ++i) {
    if (!RuleOf(*type.field(i)).default_().empty()) return true;
  }
  return false;
}

void Fill(const Places& places, const std::string& path, Message* message) {
  const auto& reflection = *message->GetReflection();
  for (const FieldDescriptor* field : FieldsOf(*message)) {
    const std::string at = PathOf(path, *field);
    const std::string& by_default = RuleOf(*field).default_();
    if (!by_default.empty() && places.count(at) == 0) ReadYamlField(by_default, *field, message);
    if (!IsMessage(*field) || field->is_map()) continue;
    if (field->is_repeated()) {
      for (int i = 0; i < reflection.FieldSize(*message, field); ++i) {
        Fill(places, ElementPath(at, i), reflection.MutableRepeatedMessage(message, field, i));
      }
    } else if (reflection.HasField(*message, field) || (path.empty() && HasDefaults(*field->message_type()))) {
      Fill(places, at, reflection.MutableMessage(message, field));
    }
  }
}

bool HasDefault(const Message& message, const FieldDescriptor& field) {
  const bool is_section = IsMessage(field) && !field.is_repeated();
  if (is_section && !message.GetReflection()->HasField(message, &field)) return true;
  const std::unique_ptr<Message> other(message.New());
  other->CopyFrom(message);
  other->GetReflection()->ClearField(other.get(), &field);
  if (is_section) Fill({}, "", other->GetReflection()->MutableMessage(other.get(), &field));
  const std::string& by_default = RuleOf(field).default_();
  if (!by_default.empty()) ReadYamlField(by_default, field, other.get());
  return MessageDifferencer::Equals(message, *other);
}

std::string Take(const std::string& path, Message* message) {
  std::string taken;
  const auto& reflection = *message->GetReflection();
  for (const FieldDescriptor* field : FieldsOf(*message)) {
    const std::string at = PathOf(path, *field);
    if (RuleOf(*field).is_addition()) {
      const std::unique_ptr<Message> alone(message->New());
      const bool has_default = HasDefault(*message, *field);
      reflection.SwapFields(message, alone.get(), {field});
      if (!has_default) taken += at + '=' + SerializeInOrder(*alone) + '\n';
    } else if (IsMessage(*field) && field->is_repeated() && !field->is_map()) {
      for (int i = 0; i < reflection.FieldSize(*message, field); ++i) {
        taken += Take(ElementPath(at, i), reflection.MutableRepeatedMessage(message, field, i));
      }
    } else if (IsMessage(*field) && !field->is_map() && reflection.HasField(*message, field)) {
      taken += Take(at, reflection.MutableMessage(message, field));
    }
  }
  return taken;
}

void AddPlaces(const Message& message, const std::string& path, Places& places) {
  const auto& reflection = *message.GetReflection();
  for (const FieldDescriptor* field : FieldsOf(message)) {
    const std::string at = PathOf(path, *field);
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 0;
    const bool is_set = field->is_repeated() ? count > 0 : reflection.HasField(message, field);
    if (is_set || field->cpp_type() == FieldDescriptor::CPPTYPE_BOOL) places[at] = {};
    if (!is_set || !IsMessage(*field) || field->is_map()) continue;
    if (!field->is_repeated()) AddPlaces(reflection.GetMessage(message, field), at, places);
    for (int i = 0; i < count; ++i) {
      AddPlaces(reflection.GetRepeatedMessage(message, field, i), ElementPath(at, i), places);
    }
  }
}

}  // namespace

const proto::FieldRule& RuleOf(const FieldDescriptor& field) { return field.options().GetExtension(proto::rule); }

void CheckFields(const Message& message, const Places& places, PlacedErrors* errors) {
  RuleChecker(places, errors).CheckMessage(message, "");
}

void FillFields(const Places& places, Message* message) { Fill(places, "", message); }

std::string TakeAdditions(Message* message) { return Take("", message); }

std::string SerializeInOrder(const Message& message) {
  std::string bytes;
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  (void)message.SerializeToCodedStream(&coded);
  coded.Trim();
  return bytes;
}

Places PlacesOf(const Message& message) {
  Places places;
  AddPlaces(message, "", places);
  return places;
}

}  // namespace moondb
