// TextLines: iterates over the lines of a text, or of a file. A file is read block by block to save memory.
//
//   Result<TextLines> lines = TextLines::OfFile("graph.g2o");
//   while (const std::optional<std::string_view> line = lines->Next()) Use(*line);
//   if (!lines->result()) return lines->result();
#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "model/error.h"

namespace moondb {

class TextLines {
 public:
  static constexpr std::size_t kLineBytesMax = 64 * 1024;

  // Requires: `text` outlives this object.
  explicit TextLines(std::string_view text) : text_(text) {}
  // Opens a file. Fails like ReadTextFile (model/text.h), but does not check the file's size; Next checks it. The
  // object must not be moved after the first call of Next.
  static Result<TextLines> OfFile(const std::filesystem::path& file);

  // Returns the next line, without "\n" or "\r\n". The line is valid until the next call. Returns nullopt at the end of
  // the text and after an error.
  std::optional<std::string_view> Next();
  // Returns the number of the line that Next returned last, counted from 1.
  std::size_t number() const { return number_; }
  // Returns the error that ended the iteration; success if there was none. The error is kInternal if the file cannot be
  // read, and kInvalid if the file exceeds kTextFileBytesMax or a line exceeds kLineBytesMax. The error's field is the
  // file, or file and line.
  const Result<void>& result() const { return result_; }

 private:
  bool ReadBlock();

  std::string_view text_;  // The text that Next has not returned yet.
  std::size_t number_ = 0;
  Result<void> result_;
  // The members below are used only for a file; text_ is then a part of buffer_.
  std::string name_;
  std::unique_ptr<std::ifstream> stream_;
  std::string buffer_;
  std::size_t bytes_read_ = 0;
};

}  // namespace moondb
