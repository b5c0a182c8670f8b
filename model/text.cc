#include "model/text.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <system_error>

#include "model/file_writing.h"

namespace moondb {

namespace {

constexpr std::int64_t kNsPerSecond = 1'000'000'000;
constexpr int kNsDigits = 9;

bool IsDigit(char c) { return c >= '0' && c <= '9'; }
bool IsBlank(char c) { return c == ' ' || c == '\t'; }

std::vector<std::string_view> SplitAtBlanks(std::string_view line) {
  std::vector<std::string_view> parts;
  std::size_t at = 0;
  while (at < line.size()) {
    while (at < line.size() && IsBlank(line[at])) ++at;
    const std::size_t begin = at;
    while (at < line.size() && !IsBlank(line[at])) ++at;
    if (at > begin) parts.push_back(line.substr(begin, at - begin));
  }
  return parts;
}

// Converts the digits after the decimal point to nanoseconds, rounded to the nearest.
std::optional<std::int64_t> FractionNs(std::string_view digits) {
  std::int64_t ns = 0;
  for (int i = 0; i < kNsDigits; ++i) {
    const bool is_given = static_cast<std::size_t>(i) < digits.size();
    if (is_given && !IsDigit(digits[i])) return std::nullopt;
    ns = ns * 10 + (is_given ? digits[i] - '0' : 0);
  }
  for (std::size_t i = kNsDigits; i < digits.size(); ++i) {
    if (!IsDigit(digits[i])) return std::nullopt;
  }
  if (digits.size() > kNsDigits && digits[kNsDigits] >= '5') ++ns;
  return ns;
}

}  // namespace

Result<void> CheckRegularFile(const std::filesystem::path& file) {
  std::error_code failure;
  const std::filesystem::file_status status = std::filesystem::status(file, failure);
  if (!std::filesystem::exists(status)) return Fail(ErrorCode::kNotFound, "no such file", file.string());
  if (!std::filesystem::is_regular_file(status))
    return Fail(ErrorCode::kInvalid, "is not a regular file", file.string());
  return {};
}

Result<std::string> ReadTextFile(const std::filesystem::path& file, std::size_t bytes_max) {
  if (const Result<void> is_file = CheckRegularFile(file); !is_file) return tl::unexpected(is_file.error());
  std::ifstream stream(file, std::ios::binary);
  if (!stream) return Fail(ErrorCode::kInternal, "cannot be opened", file.string());
  std::string text;
  std::array<char, 65536> block;
  while (stream.read(block.data(), block.size()) || stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > bytes_max) {
      return Fail(ErrorCode::kInvalid, "is larger than " + std::to_string(bytes_max) + " bytes", file.string());
    }
  }
  if (stream.bad()) return Fail(ErrorCode::kInternal, "cannot be read", file.string());
  return text;
}

Result<void> WriteTextFile(const std::filesystem::path& file, std::string_view text) {
  return WriteWholeFile(file, text, {});
}

std::string_view TakeLine(std::string_view& text) {
  const std::size_t end = text.find('\n');
  std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

std::vector<std::string_view> Split(std::string_view line, char separator) {
  if (separator == ' ') return SplitAtBlanks(line);
  std::vector<std::string_view> parts;
  while (true) {
    const std::size_t end = line.find(separator);
    parts.push_back(line.substr(0, end));
    if (end == std::string_view::npos) return parts;
    line.remove_prefix(end + 1);
  }
}

std::optional<double> ParseDouble(std::string_view text) {
  if (!text.empty() && text.front() == '+') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<std::uint64_t> ParseUnsigned(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<std::int64_t> ParseTimestampNs(std::string_view seconds) {
  const bool is_negative = !seconds.empty() && seconds.front() == '-';
  if (is_negative) seconds.remove_prefix(1);
  const std::size_t point = seconds.find('.');
  const std::optional<std::uint64_t> whole = ParseUnsigned(seconds.substr(0, point));
  const std::string_view digits = point == std::string_view::npos ? "" : seconds.substr(point + 1);
  const std::optional<std::int64_t> fraction = FractionNs(digits);
  constexpr std::uint64_t kSecondsMax = std::numeric_limits<std::int64_t>::max() / kNsPerSecond - 1;
  constexpr std::uint64_t kNanosecondsMin = 100'000'000'000'000'000;
  constexpr std::uint64_t kNanosecondsMax = std::numeric_limits<std::int64_t>::max();
  if (!whole || !fraction) return std::nullopt;
  const bool is_in_ns = *whole >= kNanosecondsMin && *whole <= kNanosecondsMax;
  if (!is_in_ns && *whole > kSecondsMax) return std::nullopt;
  const auto number = static_cast<std::int64_t>(*whole);
  const std::int64_t ns = is_in_ns ? number : number * kNsPerSecond + *fraction;
  return is_negative ? -ns : ns;
}

std::string FormatDouble(double value) {
  std::array<char, 32> buffer;
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return std::string(buffer.data(), end);
}

std::string FormatTimestampNs(std::int64_t timestamp_ns) {
  // Unsigned, because the magnitude of INT64_MIN does not fit into a signed number.
  const std::uint64_t magnitude =
      timestamp_ns < 0 ? 0 - static_cast<std::uint64_t>(timestamp_ns) : static_cast<std::uint64_t>(timestamp_ns);
  std::string text = (timestamp_ns < 0 ? "-" : "") + std::to_string(magnitude / kNsPerSecond);
  std::uint64_t fraction = magnitude % kNsPerSecond;
  if (fraction == 0) return text;
  std::string digits = std::to_string(fraction + kNsPerSecond).substr(1);
  while (digits.back() == '0') digits.pop_back();
  return text + "." + digits;
}

std::string FileLine(const std::string& file, std::size_t line) { return file + ":" + std::to_string(line); }

std::size_t Utf8CharacterBytes(std::string_view text) {
  const auto first = static_cast<unsigned char>(text[0]);
  const std::size_t length = first < 0x80   ? 1
                             : first < 0xC2 ? 0
                             : first < 0xE0 ? 2
                             : first < 0xF0 ? 3
                             : first < 0xF5 ? 4
                                            : 0;
  if (length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((static_cast<unsigned char>(text[i]) & 0xC0) != 0x80) return 0;
  }
  if (length < 3) return length;
  // Reject overlong forms, surrogates and values beyond U+10FFFF.
  const auto second = static_cast<unsigned char>(text[1]);
  const bool is_bad = (first == 0xE0 && second < 0xA0) || (first == 0xED && second > 0x9F) ||
                      (first == 0xF0 && second < 0x90) || (first == 0xF4 && second > 0x8F);
  return is_bad ? 0 : length;
}

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t bytes = Utf8CharacterBytes(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

std::string OneLine(std::string_view text, std::size_t bytes_max) {
  std::string line;
  while (!text.empty() && line.size() < bytes_max) {
    const std::size_t bytes = Utf8CharacterBytes(text);
    const bool is_c1 = bytes == 2 && text[0] == '\xC2' && static_cast<unsigned char>(text[1]) < 0xA0;
    const bool is_shown = (bytes > 1 && !is_c1) || (bytes == 1 && text.front() >= ' ' && text.front() != '\x7F');
    line += is_shown ? text.substr(0, bytes) : "?";
    text.remove_prefix(std::max<std::size_t>(bytes, 1));
  }
  return text.empty() ? line : line + "...";
}

}  // namespace moondb
