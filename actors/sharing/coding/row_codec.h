// The row codec: contents of records in columns, field by field, so that what is alike stands side by side.
//
//   rows    := row count, shape count, shapes (row_shape.h), shape of each row*, for each shape its columns
//   column  := numbers (number_column.h), or of texts: their sizes as numbers, then the texts themselves
//   * a number column; absent where there is one shape
//
// Whatever bytes the contents are, they come back as they were: a row of no known form is one text. Meant for a batch
// of one data type, right for any. Other parts of a batch are added as number columns by the caller. Nothing is
// compressed here: a general compressor finds the zeros. Pure functions, safe from any thread.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "actors/sharing/coding/byte_text.h"

namespace moondb {

inline constexpr std::size_t kRowsMax = 4096;
inline constexpr std::size_t kRowShapesMax = 32;  // Of one batch; further shapes travel as texts.

// `contents` are serialised proto::Records, or anything else; at most kRowsMax.
void PutRows(const std::vector<std::string_view>& contents, std::string& bytes);

// The contents. The reader is no longer good where the bytes are not of that form, or would make more than
// `content_bytes_max` in all. Beside them it takes at most
// kRowsMax * kShapeValuesMax * 16 bytes (32 MiB) of memory, whatever the bytes.
std::vector<std::string> TakeRows(std::size_t content_bytes_max, ByteReader& reader);

}  // namespace moondb
