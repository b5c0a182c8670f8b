// TextLines: the lines of a text, or of a file that is read block by block, so that it takes no memory of its size.
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

  // The text must outlive it.
  explicit TextLines(std::string_view text) : text_(text) {}
  // Errors as ReadTextFile of model/text.h, but for the size. Not moved once Next was called.
  static Result<TextLines> OfFile(const std::filesystem::path& file);

  // The next line, without "\n" or "\r\n", valid until the next call. None at the end, and after an error.
  std::optional<std::string_view> Next();
  // Of the line that Next returned last; the first one has number 1.
  std::size_t number() const { return number_; }
  // kInternal: the file cannot be read. kInvalid: it has more than kTextFileBytesMax bytes, or a line of it more than
  // kLineBytesMax. The error's field is the file, with the line.
  const Result<void>& result() const { return result_; }

 private:
  bool ReadBlock();

  std::string_view text_;  // Not taken yet.
  std::size_t number_ = 0;
  Result<void> result_;
  // Of a file.
  std::string name_;
  std::unique_ptr<std::ifstream> stream_;
  std::string buffer_;  // What text_ is part of.
  std::size_t bytes_read_ = 0;
};

}  // namespace moondb
