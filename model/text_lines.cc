#include "model/text_lines.h"

#include "model/text.h"

namespace moondb {

Result<TextLines> TextLines::OfFile(const std::filesystem::path& file) {
  if (const Result<void> is_file = CheckRegularFile(file); !is_file) return tl::unexpected(is_file.error());
  TextLines lines{std::string_view()};
  lines.name_ = file.string();
  lines.stream_ = std::make_unique<std::ifstream>(file, std::ios::binary);
  if (!*lines.stream_) return Fail(ErrorCode::kInternal, "cannot be opened", lines.name_);
  return lines;
}

std::optional<std::string_view> TextLines::Next() {
  while (stream_ != nullptr && text_.find('\n') == std::string_view::npos) {
    if (text_.size() > kLineBytesMax) {
      result_ = Fail(ErrorCode::kInvalid, "the line is longer than " + std::to_string(kLineBytesMax) + " bytes",
                     FileLine(name_, number_ + 1));
      return std::nullopt;
    }
    if (!ReadBlock()) break;
  }
  if (!result_ || text_.empty()) return std::nullopt;
  ++number_;
  return TakeLine(text_);
}

bool TextLines::ReadBlock() {
  buffer_.erase(0, buffer_.size() - text_.size());
  const std::size_t left = buffer_.size();
  buffer_.resize(left + kLineBytesMax);
  stream_->read(buffer_.data() + left, kLineBytesMax);
  buffer_.resize(left + static_cast<std::size_t>(stream_->gcount()));
  text_ = buffer_;
  bytes_read_ += buffer_.size() - left;
  if (bytes_read_ > kTextFileBytesMax) {
    result_ = Fail(ErrorCode::kInvalid, "is larger than " + std::to_string(kTextFileBytesMax) + " bytes", name_);
    return false;
  }
  if (stream_->bad()) result_ = Fail(ErrorCode::kInternal, "cannot be read", name_);
  return buffer_.size() > left;
}

}  // namespace moondb
