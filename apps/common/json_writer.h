// JsonWriter: writes one JSON document from left to right, for `--json`. Inserts commas and escapes strings. The caller
// must write one value after each Key. Not thread-safe.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/file_notes.h"

namespace moondb {

class JsonWriter {
 public:
  JsonWriter& BeginObject() { return Open('{'); }
  JsonWriter& EndObject() { return Close('}'); }
  JsonWriter& BeginArray() { return Open('['); }
  JsonWriter& EndArray() { return Close(']'); }
  JsonWriter& Key(std::string_view key);

  JsonWriter& String(std::string_view text);  // Bytes that are not UTF-8 become U+FFFD.
  JsonWriter& Number(double value);           // Writes null if `value` is not finite.
  JsonWriter& Bool(bool value);
  JsonWriter& Null();
  JsonWriter& Raw(std::string_view json);  // Appends `json`, which is one complete value.

  // Writes an object such as {"code":"refused","field":"...","text":"..."}.
  JsonWriter& WriteError(const Error& error);

  // Writes an object such as {"team":"mission","agent":"rover1"}.
  JsonWriter& WriteNotes(const FileNotes& notes);

  const std::string& text() const { return text_; }

 private:
  JsonWriter& Open(char bracket);
  JsonWriter& Close(char bracket);
  void Separate();  // Writes a comma if the document ends with a complete value.

  std::string text_;
  bool is_comma_due_ = false;
};

// Name of an error code for scripts, such as "not_found".
std::string ErrorCodeName(ErrorCode code);

}  // namespace moondb
