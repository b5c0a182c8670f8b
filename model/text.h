// Helpers to read and write text files: whole files, lines, and numbers that survive a round trip. Independent of the
// locale.
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

// Fails with kNotFound if the file is absent, and with kInvalid if the file is not a regular file: a pipe would block
// its reader, and a device may be endless. The error's field is the path.
Result<void> CheckRegularFile(const std::filesystem::path& file);

// Reads a whole file. Fails with kNotFound if the file is absent, with kInvalid if the file is larger than `bytes_max`
// or not a regular file, and with kInternal if reading fails. The error's field is the path.
Result<std::string> ReadTextFile(const std::filesystem::path& file, std::size_t bytes_max = kTextFileBytesMax);

// Replaces a file atomically: writes a temporary file beside it and renames the temporary file. Fails with kInternal;
// the error's field is the path.
Result<void> WriteTextFile(const std::filesystem::path& file, std::string_view text);

// Removes the first line from `text` and returns it, without "\n" or "\r\n".
std::string_view TakeLine(std::string_view& text);

// Splits a line at each `separator`. If `separator` is a space, runs of spaces and tabs count as one separator, and
// both ends of the line are trimmed.
std::vector<std::string_view> Split(std::string_view line, char separator);

// Parse the whole text as a number; ParseDouble accepts only finite numbers. Return nullopt for other text: "", "1x",
// "nan", "inf", "1e999".
std::optional<double> ParseDouble(std::string_view text);
std::optional<std::uint64_t> ParseUnsigned(std::string_view text);

// Converts decimal seconds ("12", "-0.5", "1671300425.3106995") to nanoseconds. Exact up to the ninth decimal; further
// decimals are rounded. A number from 1e17 on cannot be seconds and is read as nanoseconds since 1970; some graph files
// hold those. Returns nullopt for other text, and for numbers that do not fit.
std::optional<std::int64_t> ParseTimestampNs(std::string_view seconds);

// Returns the shortest text that reads back as exactly this number.
std::string FormatDouble(double value);

// Converts nanoseconds to exact decimal seconds: "10", "1671300425.3106995".
std::string FormatTimestampNs(std::int64_t timestamp_ns);

// Returns the length in bytes of the UTF-8 character at the front of `text`. Returns 0 for invalid UTF-8, including
// overlong forms, surrogates and values beyond U+10FFFF. Requires: `text` is not empty.
std::size_t Utf8CharacterBytes(std::string_view text);
bool IsUtf8(std::string_view text);

// Makes untrusted text safe to display: one line of UTF-8, cut to about `bytes_max` bytes. Control characters and
// invalid bytes become '?'.
std::string OneLine(std::string_view text, std::size_t bytes_max = 256);

// Returns `file` and `line` as the field of an error: "graph.pyfg:12".
std::string FileLine(const std::string& file, std::size_t line);

}  // namespace moondb
