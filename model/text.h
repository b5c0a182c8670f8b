// Small pieces that every reader and writer of text files needs: whole files, lines, numbers that survive a round trip.
//
// Locale plays no part. All functions are pure but for the three that touch a file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"

namespace moondb {

inline constexpr std::size_t kTextFileBytesMax = 256 * 1024 * 1024;

// kNotFound if it is absent, kInvalid if it is no regular file: a pipe would keep its reader waiting, a device would
// not end. The error's field is the path.
Result<void> CheckRegularFile(const std::filesystem::path& file);

// The whole file. kNotFound if it is absent, kInvalid if it is larger than `bytes_max` or no regular file, kInternal
// if reading fails; the error's field is the path.
Result<std::string> ReadTextFile(const std::filesystem::path& file, std::size_t bytes_max = kTextFileBytesMax);

// Writes beside the file first and renames then, so that nobody reads half a file. kInternal with the path as field.
Result<void> WriteTextFile(const std::filesystem::path& file, std::string_view text);

// Takes the next line off the front of `text`, without "\n" or "\r\n".
std::string_view TakeLine(std::string_view& text);

// Parts between single `separator`s; a space as separator takes runs of spaces and tabs as one and trims both ends.
std::vector<std::string_view> Split(std::string_view line, char separator);

// The whole of `text` as a finite number; nothing for anything else ("", "1x", "nan", "inf", "1e999").
std::optional<double> ParseDouble(std::string_view text);
std::optional<std::uint64_t> ParseUnsigned(std::string_view text);

// Decimal seconds to nanoseconds without passing through a double; digits behind the ninth are rounded. Nothing if it
// is no plain decimal number ("12", "-0.5", "1671300425.3106995") or does not fit.
std::optional<std::int64_t> ParseTimestampNs(std::string_view seconds);

// The shortest text that reads back as exactly this number.
std::string FormatDouble(double value);

// Seconds, exact: "10", "1671300425.3106995".
std::string FormatTimestampNs(std::int64_t timestamp_ns);

// Bytes of the UTF-8 character at the front of `text`, which is not empty; 0 if it is none: overlong forms, surrogates
// and what lies beyond U+10FFFF are none.
std::size_t Utf8CharacterBytes(std::string_view text);
bool IsUtf8(std::string_view text);

// What a stranger says, to be shown to people: one line of UTF-8, the rest of it as '?', cut to about `bytes_max`.
std::string OneLine(std::string_view text, std::size_t bytes_max = 256);

// "graph.pyfg:12", the field of an error in a file.
std::string FileLine(const std::string& file, std::size_t line);

}  // namespace moondb
