#include "apps/common/table.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>

namespace moondb {
namespace {

constexpr char kRed[] = "\x1b[31m";
constexpr char kPlain[] = "\x1b[0m";

// Counts characters, not bytes, to keep names in UTF-8 aligned.
std::size_t Width(const std::string& text) {
  return static_cast<std::size_t>(
      std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; }));
}

bool IsNumber(const std::string& text) {
  return !text.empty() && text.find_first_not_of("0123456789.-") == std::string::npos && text != "-";
}

std::string Format(const char* format, double value, const char* unit) {
  char text[64];
  std::snprintf(text, sizeof(text), format, value, unit);
  return text;
}

}  // namespace

std::string Table::Text(bool is_colored) const {
  std::vector<std::size_t> widths;
  for (const auto& [row, tone] : rows_) {
    // The last cell of a row is not padded.
    for (std::size_t i = 0; i + 1 < row.size(); ++i) {
      if (i >= widths.size()) widths.resize(i + 1, 0);
      widths[i] = std::max(widths[i], Width(row[i]));
    }
  }
  std::string text;
  for (const auto& [row, tone] : rows_) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const bool is_last = i + 1 == row.size();
      const std::string padding(is_last ? 0 : widths[i] - Width(row[i]), ' ');
      line += (i == 0 ? "" : "  ") + (IsNumber(row[i]) ? padding + row[i] : row[i] + padding);
    }
    std::replace_if(
        line.begin(), line.end(), [](char c) { return static_cast<unsigned char>(c) < 0x20; }, '?');
    line.resize(line.find_last_not_of(' ') + 1);
    text += (is_colored && tone == Tone::kBad ? kRed + line + kPlain : line) + '\n';
  }
  return text;
}

std::string FormatBytes(double bytes) {
  static constexpr std::array<const char*, 4> kUnits{"B", "kB", "MB", "GB"};
  std::size_t unit = 0;
  for (; bytes >= 1000 && unit + 1 < kUnits.size(); ++unit) bytes /= 1000;
  return Format(unit == 0 ? "%.0f %s" : "%.1f %s", bytes, kUnits[unit]);
}

std::string FormatSeconds(double seconds) {
  if (seconds < 0) return "never";
  if (seconds < 120) return Format("%.0f %s", seconds, "s");
  if (seconds < 7200) return Format("%.0f %s", seconds / 60, "min");
  return Format("%.1f %s", seconds / 3600, "h");
}

std::string FormatUtc(std::int64_t timestamp_ns) {
  if (timestamp_ns == 0) return "-";
  const auto seconds = static_cast<std::time_t>(timestamp_ns / 1'000'000'000);
  std::tm utc{};
  char text[64];
  if (gmtime_r(&seconds, &utc) == nullptr) return "-";
  std::strftime(text, sizeof(text), "%Y-%m-%d %H:%M:%S UTC", &utc);
  return text;
}

std::string FormatFixed(double value, int digits) {
  char text[400];  // The largest double has 309 digits before the point.
  std::snprintf(text, sizeof(text), "%.*f", digits, value);
  return text;
}

std::string FormatCount(double count) { return Format("%.0f%s", count, ""); }

std::string FormatCount(double count, const std::string& noun, const std::string& plural) {
  return FormatCount(count) + " " + (count == 1 ? noun : plural.empty() ? noun + "s" : plural);
}

}  // namespace moondb
