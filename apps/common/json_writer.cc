#include "apps/common/json_writer.h"

#include <cmath>

#include "model/json_text.h"
#include "model/text.h"

namespace moondb {

void JsonWriter::Separate() {
  if (is_comma_due_) text_ += ',';
  is_comma_due_ = true;
}

JsonWriter& JsonWriter::Open(char bracket) {
  Separate();
  text_ += bracket;
  is_comma_due_ = false;
  return *this;
}

JsonWriter& JsonWriter::Close(char bracket) {
  text_ += bracket;
  is_comma_due_ = true;
  return *this;
}

JsonWriter& JsonWriter::Key(std::string_view key) {
  String(key);
  text_ += ':';
  is_comma_due_ = false;
  return *this;
}

JsonWriter& JsonWriter::String(std::string_view text) {
  Separate();
  text_ += JsonString(text);
  return *this;
}

JsonWriter& JsonWriter::Number(double value) {
  if (!std::isfinite(value)) return Null();
  return Raw(FormatDouble(value));
}

JsonWriter& JsonWriter::Bool(bool value) { return Raw(value ? "true" : "false"); }

JsonWriter& JsonWriter::Null() { return Raw("null"); }

JsonWriter& JsonWriter::Raw(std::string_view json) {
  Separate();
  text_ += json;
  return *this;
}

JsonWriter& JsonWriter::WriteError(const Error& error) {
  BeginObject().Key("code").String(ErrorCodeName(error.code));
  Key("field").String(error.field).Key("text").String(error.text);
  return EndObject();
}

JsonWriter& JsonWriter::WriteNotes(const FileNotes& notes) {
  BeginObject();
  for (const auto& [key, text] : notes) Key(key).String(text);
  return EndObject();
}

std::string ErrorCodeName(ErrorCode code) {
  switch (code) {
    case ErrorCode::kInvalid:
      return "invalid";
    case ErrorCode::kNotFound:
      return "not_found";
    case ErrorCode::kRefused:
      return "refused";
    case ErrorCode::kUnavailable:
      return "unavailable";
    case ErrorCode::kTimedOut:
      return "timed_out";
    case ErrorCode::kCorrupt:
      return "corrupt";
    case ErrorCode::kFull:
      return "full";
    case ErrorCode::kInternal:
      break;
  }
  return "internal";
}

}  // namespace moondb
