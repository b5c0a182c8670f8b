// RowShape: how a record's content is built on the wire (protobuf's tags, in their order and nesting), without values.
//
// Rows of one shape differ in their values alone, so these can stand in columns, and the content is made again from
// shape and values byte for byte: field by field as it was, in its order, fields that are unknown here as well. What is
// not in the shortest form, or too much for a shape, is one field of bytes. Pure.
#pragma once

#include <google/protobuf/descriptor.h>

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "actors/sharing/coding/byte_text.h"

namespace moondb {

enum class Part : std::uint8_t {
  kContent = 0,  // The whole row, as bytes; then it is the only part.
  kVarint = 1,
  kFixed64 = 2,
  kFixed32 = 3,
  kBytes = 4,    // Any field with a length.
  kDoubles = 5,  // The same of `count` 64-bit numbers.
  kMessage = 6,  // The same, made of the parts up to the next kEnd on this level.
  kEnd = 7,
};

struct ShapePart {
  Part part = Part::kContent;
  std::uint32_t tag = 0;    // Field number and wire type.
  std::uint32_t count = 0;  // Of kDoubles.
  bool operator==(const ShapePart&) const = default;
};

using RowShape = std::vector<ShapePart>;

inline constexpr std::size_t kShapePartsMax = 256;
inline constexpr std::uint32_t kShapeDoublesMax = 64;
inline constexpr std::size_t kShapeDepthMax = 16;
inline constexpr std::size_t kShapeValuesMax = 512;

// The values of one row's parts: a number for kVarint and the fixed ones, `count` of them for kDoubles, and bytes for
// kBytes and kContent; in the order of the parts.
struct RowValues {
  std::vector<std::uint64_t> numbers;
  std::vector<std::string_view> texts;  // Within the row.
};

// How many of each a row of this shape has.
struct ValueCount {
  std::size_t numbers = 0;
  std::size_t texts = 0;
};
ValueCount CountValues(const RowShape& shape);

// The shape of a row whose message `type` describes; it tells messages from other bytes.
RowShape FindShape(std::string_view row, const google::protobuf::Descriptor& type);

// The row's values, if it is of this shape; whatever else it is, MakeRow of these is `row` again.
bool ReadRow(std::string_view row, const RowShape& shape, RowValues& values);

// Puts the row before `end` and returns where it begins. There must be room for RowBytesMax. The values must be as many
// as CountValues says; numbers of kFixed32 lose their upper half.
char* MakeRow(const RowShape& shape, const RowValues& values, char* end);
std::size_t RowBytesMax(const RowShape& shape, const RowValues& values);

void PutShape(const RowShape& shape, std::string& bytes);
// The reader is no longer good where a shape breaks a limit above, a tag is not one of its part, or kEnd does not
// match.
RowShape TakeShape(ByteReader& reader);

}  // namespace moondb
