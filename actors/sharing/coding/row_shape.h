// RowShape: the structure of a record's protobuf encoding: the tags in their order and nesting, without values.
//
// Rows of one shape differ only in their values, so the values can be stored in columns. Shape and values together
// restore the content byte for byte, including unknown fields. If a row is not in the shortest encoding or exceeds the
// limits of a shape, its shape is a single kContent, and the row is stored as bytes.
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
  kContent = 0,  // The whole row as bytes; such a shape has no other part.
  kVarint = 1,
  kFixed64 = 2,
  kFixed32 = 3,
  kBytes = 4,    // A length-delimited field.
  kDoubles = 5,  // A length-delimited field of `count` 64-bit numbers.
  kMessage = 6,  // A length-delimited message: the parts up to the matching kEnd.
  kEnd = 7,
};

struct ShapePart {
  Part part = Part::kContent;
  std::uint32_t tag = 0;    // Field number and wire type.
  std::uint32_t count = 0;  // Number of values of kDoubles.
  bool operator==(const ShapePart&) const = default;
};

using RowShape = std::vector<ShapePart>;

inline constexpr std::size_t kShapePartsMax = 256;
inline constexpr std::uint32_t kShapeDoublesMax = 64;
inline constexpr std::size_t kShapeDepthMax = 16;
inline constexpr std::size_t kShapeValuesMax = 512;

// The values of one row, in the order of its parts: a number for kVarint, kFixed64 and kFixed32, `count` numbers for
// kDoubles, and bytes for kBytes and kContent.
struct RowValues {
  std::vector<std::uint64_t> numbers;
  std::vector<std::string_view> texts;  // Views into the row.
};

// How many numbers and how many texts a row of one shape has.
struct ValueCount {
  std::size_t numbers = 0;
  std::size_t texts = 0;
};
ValueCount CountValues(const RowShape& shape);

// Returns the shape of a row. `type` describes the row's message; it distinguishes nested messages from other bytes.
RowShape FindShape(std::string_view row, const google::protobuf::Descriptor& type);

// Reads the values of a row. Returns false if the row is not of this shape. Otherwise MakeRow restores exactly `row`
// from the shape and the values.
bool ReadRow(std::string_view row, const RowShape& shape, RowValues& values);

// Writes the row so that it ends at `end`, and returns its first byte. Requires: RowBytesMax bytes of room before
// `end`, and as many values as CountValues returns. Numbers of kFixed32 are truncated to 32 bits.
char* MakeRow(const RowShape& shape, const RowValues& values, char* end);
std::size_t RowBytesMax(const RowShape& shape, const RowValues& values);

void PutShape(const RowShape& shape, std::string& bytes);
// Reads a shape. Marks the reader as failed if the shape exceeds a limit above, the wire type of a tag does not match
// its part, or the kMessage and kEnd parts do not match.
RowShape TakeShape(ByteReader& reader);

}  // namespace moondb
