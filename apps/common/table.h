// Table: rows of text in aligned columns. Functions that format bytes, times and numbers. Not thread-safe.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "apps/common/terminal.h"

namespace moondb {

// Colour of a row on a colour terminal: kBad is red. No tone is green, because a row without a known fault may still be
// faulty.
enum class Tone { kPlain, kBad };

class Table {
 public:
  explicit Table(std::vector<std::string> header) : rows_{{std::move(header), Tone::kPlain}} {}

  // A row may be shorter or longer than the header. The last cell of a row is never padded.
  void Add(std::vector<std::string> row, Tone tone = Tone::kPlain) { rows_.push_back({std::move(row), tone}); }

  // Returns one line per row. Columns are two spaces apart, numbers are right-aligned, and control characters become
  // '?'.
  std::string Text(bool is_colored = AreColorsWanted()) const;

 private:
  struct Row {
    std::vector<std::string> cells;
    Tone tone;
  };
  std::vector<Row> rows_;
};

// Formats a number of bytes: "1.5 MB", "812 B". Units are powers of 1000.
std::string FormatBytes(double bytes);
// Formats a duration: "35 s", "4 min", "2.5 h". Returns "never" if `seconds` is negative.
std::string FormatSeconds(double seconds);
// Formats `timestamp_ns`, which counts from 1970: "2026-11-21 14:54:33 UTC". Returns "-" for 0, which means no time.
std::string FormatUtc(std::int64_t timestamp_ns);
// Returns `value` with `digits` decimal places: "0.34".
std::string FormatFixed(double value, int digits);
// Formats a whole number that is stored as a double: "12".
std::string FormatCount(double count);
// Formats a whole number with its noun: "1 record", "12 records". `plural` is needed if it is not the noun with an s.
std::string FormatCount(double count, const std::string& noun, const std::string& plural = {});

}  // namespace moondb
