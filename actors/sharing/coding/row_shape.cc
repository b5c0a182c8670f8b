#include "actors/sharing/coding/row_shape.h"

#include <algorithm>
#include <array>
#include <optional>

#include "model/check.h"

namespace moondb {

namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;

enum WireType : std::uint32_t { kWireVarint = 0, kWireFixed64 = 1, kWireLength = 2, kWireFixed32 = 5 };
constexpr std::size_t kDoubleBytes = 8;
constexpr std::uint64_t kTagMax = 0xFFFFFFFF;

std::optional<std::uint32_t> WireTypeOf(Part part) {
  switch (part) {
    case Part::kVarint:
      return kWireVarint;
    case Part::kFixed64:
      return kWireFixed64;
    case Part::kFixed32:
      return kWireFixed32;
    case Part::kBytes:
    case Part::kDoubles:
    case Part::kMessage:
      return kWireLength;
    case Part::kContent:
    case Part::kEnd:
      break;
  }
  return std::nullopt;
}

bool HasFewValues(const RowShape& shape) {
  const ValueCount count = CountValues(shape);
  return count.numbers + count.texts <= kShapeValuesMax;
}

class ShapeFinder {
 public:
  // Returns the shape, or nullopt if the row must be stored as bytes.
  std::optional<RowShape> Find(std::string_view row, const Descriptor& type) {
    if (!AddMessage(row, &type, 0) || !HasFewValues(shape_)) return std::nullopt;
    return std::move(shape_);
  }

 private:
  bool AddMessage(std::string_view bytes, const Descriptor* type, std::size_t depth) {
    if (depth > kShapeDepthMax) return false;
    ByteReader reader(bytes);
    while (!reader.IsAtEnd()) {
      if (!AddField(reader, type, depth)) return false;
    }
    return reader.is_good();
  }

  bool AddField(ByteReader& reader, const Descriptor* type, std::size_t depth) {
    const std::uint64_t tag = reader.Varint();
    if (tag > kTagMax || tag >> 3 == 0 || shape_.size() >= kShapePartsMax) return false;
    const auto add = [&](Part part, std::uint32_t count = 0) {
      shape_.push_back({part, static_cast<std::uint32_t>(tag), count});
    };
    switch (tag & 7) {
      case kWireVarint:
        reader.Varint();
        add(Part::kVarint);
        break;
      case kWireFixed64:
        reader.Bytes(8);
        add(Part::kFixed64);
        break;
      case kWireFixed32:
        reader.Bytes(4);
        add(Part::kFixed32);
        break;
      case kWireLength: {
        const std::string_view bytes = reader.Bytes(reader.Varint());
        if (!reader.is_good()) return false;
        return AddLength(static_cast<std::uint32_t>(tag), bytes, type, depth);
      }
      default:
        return false;
    }
    return reader.is_good();
  }

  bool AddLength(std::uint32_t tag, std::string_view bytes, const Descriptor* type, std::size_t depth) {
    const FieldDescriptor* field = type->FindFieldByNumber(static_cast<int>(tag >> 3));
    if (field && field->type() == FieldDescriptor::TYPE_MESSAGE) {
      const std::size_t before = shape_.size();
      shape_.push_back({Part::kMessage, tag, 0});
      if (AddMessage(bytes, field->message_type(), depth + 1) && shape_.size() < kShapePartsMax) {
        shape_.push_back({Part::kEnd, 0, 0});
        return true;
      }
      shape_.resize(before);
    }
    const bool is_doubles = field && field->type() == FieldDescriptor::TYPE_DOUBLE && !bytes.empty() &&
                            bytes.size() % kDoubleBytes == 0 && bytes.size() / kDoubleBytes <= kShapeDoublesMax;
    if (is_doubles) {
      shape_.push_back({Part::kDoubles, tag, static_cast<std::uint32_t>(bytes.size() / kDoubleBytes)});
    } else {
      shape_.push_back({Part::kBytes, tag, 0});
    }
    return true;
  }

  RowShape shape_;
};

// Checks a row against a shape and extracts its values.
class RowReader {
 public:
  RowReader(std::string_view row, RowValues& values) : reader_(row), values_(values) {}

  bool Read(const RowShape& shape) {
    for (const ShapePart& part : shape) {
      if (!Read(part)) return false;
    }
    return depth_ == 0 && reader_.IsAtEnd() && reader_.is_good();
  }

 private:
  bool Read(const ShapePart& part) {
    if (part.part == Part::kEnd) return left_behind_[--depth_] == reader_.left();
    if (part.part == Part::kContent) {
      values_.texts.push_back(reader_.Bytes(reader_.left()));
      return true;
    }
    if (reader_.Varint() != part.tag) return false;
    switch (part.part) {
      case Part::kVarint:
        values_.numbers.push_back(reader_.Varint());
        break;
      case Part::kFixed64:
        values_.numbers.push_back(reader_.Fixed(8));
        break;
      case Part::kFixed32:
        values_.numbers.push_back(reader_.Fixed(4));
        break;
      case Part::kBytes:
        values_.texts.push_back(reader_.Bytes(reader_.Varint()));
        break;
      case Part::kDoubles:
        if (reader_.Varint() != part.count * kDoubleBytes) return false;
        for (std::uint32_t i = 0; i < part.count; ++i) values_.numbers.push_back(reader_.Fixed(8));
        break;
      case Part::kMessage: {
        const std::uint64_t size = reader_.Varint();
        if (!reader_.is_good() || size > reader_.left()) return false;
        left_behind_[depth_++] = reader_.left() - size;
        break;
      }
      case Part::kContent:
      case Part::kEnd:
        break;
    }
    return reader_.is_good();
  }

  ByteReader reader_;
  RowValues& values_;
  // For each enclosing message, the number of bytes of the row that follow the message's end. A shape from FindShape
  // may nest one level deeper than kShapeDepthMax.
  std::array<std::size_t, kShapeDepthMax + 1> left_behind_{};
  std::size_t depth_ = 0;
};

// Writes a row backwards, from its end, because the length of a message is then known before its length field is
// written.
class RowMaker {
 public:
  RowMaker(const RowValues& values, char* end)
      : number_(values.numbers.data() + values.numbers.size()),
        text_(values.texts.data() + values.texts.size()),
        at_(end) {}

  char* Make(const RowShape& shape) {
    for (std::size_t i = shape.size(); i-- > 0;) Make(shape[i]);
    return at_;
  }

 private:
  void Make(const ShapePart& part) {
    switch (part.part) {
      case Part::kEnd:
        ends_[depth_++] = at_;
        return;
      case Part::kContent:
        Put(*--text_);
        return;
      case Part::kVarint:
        PutVarint(*--number_);
        break;
      case Part::kFixed64:
        PutFixed(*--number_, 8);
        break;
      case Part::kFixed32:
        PutFixed(*--number_, 4);
        break;
      case Part::kBytes:
        Put(*--text_);
        PutVarint(text_->size());
        break;
      case Part::kDoubles:
        for (std::uint32_t i = 0; i < part.count; ++i) PutFixed(*--number_, 8);
        PutVarint(part.count * kDoubleBytes);
        break;
      case Part::kMessage:
        PutVarint(static_cast<std::uint64_t>(ends_[--depth_] - at_));
        break;
    }
    PutVarint(part.tag);
  }

  void Put(std::string_view bytes) {
    at_ -= bytes.size();
    std::copy(bytes.begin(), bytes.end(), at_);
  }
  void PutFixed(std::uint64_t value, std::size_t byte_count) {
    at_ -= byte_count;
    for (std::size_t i = 0; i < byte_count; ++i) at_[i] = static_cast<char>(value >> (8 * i));
  }
  void PutVarint(std::uint64_t value) {
    at_ -= VarintSize(value);
    char* to = at_;
    for (; value >= 0x80; value >>= 7) *to++ = static_cast<char>(value | 0x80);
    *to = static_cast<char>(value);
  }

  const std::uint64_t* number_;
  const std::string_view* text_;
  char* at_;
  std::array<char*, kShapeDepthMax + 1> ends_{};
  std::size_t depth_ = 0;
};

// Returns true if the parts nest correctly and no deeper than kShapeDepthMax, their tags match, and the number of
// values is within the limit.
bool IsWellFormed(const RowShape& shape) {
  std::size_t depth = 0;
  for (const ShapePart& part : shape) {
    if (part.part == Part::kContent && shape.size() != 1) return false;
    if (part.part == Part::kMessage && ++depth > kShapeDepthMax) return false;
    if (part.part == Part::kEnd && depth-- == 0) return false;
    const std::optional<std::uint32_t> wire_type = WireTypeOf(part.part);
    if (wire_type && ((part.tag & 7) != *wire_type || part.tag >> 3 == 0)) return false;
  }
  return depth == 0 && HasFewValues(shape);
}

}  // namespace

ValueCount CountValues(const RowShape& shape) {
  ValueCount count;
  for (const ShapePart& part : shape) {
    if (part.part == Part::kBytes || part.part == Part::kContent) ++count.texts;
    if (part.part == Part::kVarint || part.part == Part::kFixed64 || part.part == Part::kFixed32) ++count.numbers;
    if (part.part == Part::kDoubles) count.numbers += part.count;
  }
  return count;
}

RowShape FindShape(std::string_view row, const Descriptor& type) {
  return ShapeFinder().Find(row, type).value_or(RowShape{ShapePart{}});
}

bool ReadRow(std::string_view row, const RowShape& shape, RowValues& values) {
  values.numbers.clear();
  values.texts.clear();
  return RowReader(row, values).Read(shape);
}

char* MakeRow(const RowShape& shape, const RowValues& values, char* end) { return RowMaker(values, end).Make(shape); }

std::size_t RowBytesMax(const RowShape& shape, const RowValues& values) {
  std::size_t size = shape.size() * 2 * kVarintBytesMax + values.numbers.size() * kVarintBytesMax;
  for (const std::string_view text : values.texts) size += text.size();
  return size;
}

void PutShape(const RowShape& shape, std::string& bytes) {
  PutVarint(shape.size(), bytes);
  for (const ShapePart& part : shape) {
    bytes.push_back(static_cast<char>(part.part));
    if (WireTypeOf(part.part)) PutVarint(part.tag, bytes);
    if (part.part == Part::kDoubles) PutVarint(part.count, bytes);
  }
}

RowShape TakeShape(ByteReader& reader) {
  const std::uint64_t size = reader.Varint();
  if (size > kShapePartsMax) reader.Fail();
  RowShape shape;
  for (std::uint64_t i = 0; i < size && reader.is_good(); ++i) {
    const std::uint64_t part = reader.Fixed(1);
    if (part > static_cast<std::uint64_t>(Part::kEnd)) reader.Fail();
    shape.push_back({static_cast<Part>(part), 0, 0});
    ShapePart& added = shape.back();
    const std::uint64_t tag = WireTypeOf(added.part) ? reader.Varint() : 0;
    const std::uint64_t count = added.part == Part::kDoubles ? reader.Varint() : 0;
    if (tag > kTagMax || count > kShapeDoublesMax) reader.Fail();
    added.tag = static_cast<std::uint32_t>(tag);
    added.count = static_cast<std::uint32_t>(count);
  }
  if (reader.is_good() && !IsWellFormed(shape)) reader.Fail();
  // Return no shape after a failure: the caller allocates a column for each value of the shape.
  return reader.is_good() ? shape : RowShape();
}

}  // namespace moondb
