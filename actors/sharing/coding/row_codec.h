// The row codec: stores the contents of records column by column, one column per field, so that similar values are
// adjacent.
//
//   rows    := row count, shape count, shapes (row_shape.h), shape of each row*, for each shape its columns
//   column  := numbers (number_column.h), or texts: their sizes as numbers, then the texts themselves
//   * a number column; absent if there is one shape
//
// Any content is restored byte for byte: a row of unknown form is stored as one text. The output is smallest for
// records of one data type. The row codec does not compress: its output contains many zeros, which a general-purpose
// compressor removes. Thread-safe.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "actors/sharing/coding/byte_text.h"

namespace moondb {

inline constexpr std::size_t kRowsMax = 4096;
inline constexpr std::size_t kRowShapesMax = 32;  // Shapes of one batch; rows of further shapes are stored as texts.

// Appends the rows to `bytes`. `contents` are serialised proto::Records or any other bytes. Requires: at most kRowsMax
// contents.
void PutRows(const std::vector<std::string_view>& contents, std::string& bytes);

// Reads the rows and returns the contents. Marks the reader as failed if the bytes are malformed, or if the contents
// have more than `content_bytes_max` bytes in all. Besides the contents, takes at most kRowsMax * kShapeValuesMax * 16
// bytes (32 MiB) of memory, even if the bytes are malformed.
std::vector<std::string> TakeRows(std::size_t content_bytes_max, ByteReader& reader);

}  // namespace moondb
