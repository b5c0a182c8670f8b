// JsonWriter: one JSON document, written from left to right, for `--json`.
//
// Commas and escapes are its own work; the order of calls is the caller's (a value after each Key). Messages come in as
// text through Raw (see ToJson). Plain value, not thread-safe.
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
  JsonWriter& Number(double value);           // null for what is not finite.
  JsonWriter& Bool(bool value);
  JsonWriter& Null();
  JsonWriter& Raw(std::string_view json);  // A whole value.

  // {"code":"refused","field":"...","text":"..."}
  JsonWriter& WriteError(const Error& error);

  // {"team":"mission","agent":"rover1"}
  JsonWriter& WriteNotes(const FileNotes& notes);

  const std::string& text() const { return text_; }

 private:
  JsonWriter& Open(char bracket);
  JsonWriter& Close(char bracket);
  void Separate();  // A comma where one is due.

  std::string text_;
  bool is_comma_due_ = false;
};

// "not_found": the error's name for scripts.
std::string ErrorCodeName(ErrorCode code);

}  // namespace moondb
