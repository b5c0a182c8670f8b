// Table: rows of text in aligned columns, for people. Plain value.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/common/terminal.h"

namespace moondb {

// How a row stands out where colours are wanted. Nothing is green: what is not known to be bad is not known to be good.
enum class Tone { kPlain, kBad };

class Table {
 public:
  explicit Table(std::vector<std::string> header) : rows_{{std::move(header), Tone::kPlain}} {}

  // A row may be shorter than the header, or longer: its last cell is never padded.
  void Add(std::vector<std::string> row, Tone tone = Tone::kPlain) { rows_.push_back({std::move(row), tone}); }

  // One line each, columns two spaces apart, numbers to the right; control characters are shown as '?'.
  std::string Text(bool is_colored = AreColorsWanted()) const;

 private:
  struct Row {
    std::vector<std::string> cells;
    Tone tone;
  };
  std::vector<Row> rows_;
};

// "1.5 MB", "812 B": powers of 1000.
std::string FormatBytes(double bytes);
// "35 s", "4 min", "2.5 h".
std::string FormatSeconds(double seconds);
// "2026-11-21 14:54:33 UTC", of nanoseconds since 1970; "-" for 0, which stands for no time.
std::string FormatUtc(std::int64_t timestamp_ns);
// With so many digits behind the point: "0.34".
std::string FormatFixed(double value, int digits);
// A count that came as a double: "12".
std::string FormatCount(double count);

}  // namespace moondb
