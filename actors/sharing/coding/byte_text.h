// Writes numbers into a string of bytes, and reads them with a reader that never reads past the end.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace moondb {

inline constexpr std::size_t kVarintBytesMax = 10;

// Appends a varint as in protobuf: seven bits per byte, lowest bits first, in the shortest form.
inline void PutVarint(std::uint64_t value, std::string& bytes) {
  for (; value >= 0x80; value >>= 7) bytes.push_back(static_cast<char>(value | 0x80));
  bytes.push_back(static_cast<char>(value));
}

constexpr std::size_t VarintSize(std::uint64_t value) {
  std::size_t size = 1;
  for (; value >= 0x80; value >>= 7) ++size;
  return size;
}

// Reads numbers and bytes in order. After the first failed read, is_good() is false and every read returns 0 or an
// empty view.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : next_(bytes.data()), end_(bytes.data() + bytes.size()) {}

  bool is_good() const { return is_good_; }
  bool IsAtEnd() const { return next_ == end_; }
  std::size_t left() const { return static_cast<std::size_t>(end_ - next_); }
  const char* next() const { return next_; }

  // Reads a varint. Fails also if the number is not in its shortest form.
  std::uint64_t Varint() {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < kVarintBytesMax && next_ != end_; ++i) {
      const std::uint64_t byte = static_cast<unsigned char>(*next_++);
      value |= (byte & 0x7F) << (7 * i);
      if (byte >= 0x80) continue;
      const bool is_shortest = i == 0 || byte != 0;
      const bool fits = i + 1 < kVarintBytesMax || byte == 1;
      return is_shortest && fits ? value : Bad();
    }
    return Bad();
  }

  // Reads a little-endian number of `byte_count` bytes.
  std::uint64_t Fixed(std::size_t byte_count) {
    const std::string_view bytes = Bytes(byte_count);
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      value |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[i])) << (8 * i);
    }
    return value;
  }

  std::string_view Bytes(std::uint64_t count) {
    if (count > left()) {
      Fail();
      return {};
    }
    const std::string_view bytes(next_, static_cast<std::size_t>(count));
    next_ += count;
    return bytes;
  }

  // Marks the reader as failed, for a caller that found an invalid value.
  void Fail() {
    is_good_ = false;
    next_ = end_;
  }

 private:
  std::uint64_t Bad() {
    Fail();
    return 0;
  }

  const char* next_;
  const char* end_;
  bool is_good_ = true;
};

inline void PutFixed(std::uint64_t value, std::size_t byte_count, std::string& bytes) {
  for (std::size_t i = 0; i < byte_count; ++i) bytes.push_back(static_cast<char>(value >> (8 * i)));
}

}  // namespace moondb
