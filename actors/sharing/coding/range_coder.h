// A 32-bit binary range coder without carries: a written byte never changes.
//
// Each bit is coded with the probability that it is 1, from 1 to 65535 in units of 1/65536. The decoder never fails: it
// reads zeros after the end of its bytes, and decodes wrong bits from damaged or truncated input. The caller therefore
// needs a checksum.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "actors/sharing/coding/logistic.h"

namespace moondb {

class RangeEncoder {
 public:
  static constexpr bool kIsEncoder = true;

  // Encodes a bit. Returns `bit`, so encoder and decoder can share code.
  int Code(int bit, int probability) {
    const std::uint32_t middle = low_ + static_cast<std::uint32_t>((static_cast<std::uint64_t>(high_ - low_) *
                                                                    static_cast<std::uint32_t>(probability)) >>
                                                                   kProbabilityBits);
    if (bit != 0) {
      high_ = middle;
    } else {
      low_ = middle + 1;
    }
    while (((low_ ^ high_) >> 24) == 0) {
      bytes_.push_back(static_cast<char>(high_ >> 24));
      low_ <<= 8;
      high_ = high_ << 8 | 0xFF;
    }
    return bit;
  }

  std::size_t byte_count() const { return bytes_.size(); }

  // Returns the complete string and resets the encoder. Trailing zero bytes are removed.
  std::string Finish() {
    // The first bytes of low_ and high_ differ, so this byte followed by zeros is a number between low_ and high_.
    if (low_ != 0) bytes_.push_back(static_cast<char>((low_ >> 24) + 1));
    low_ = 0;
    high_ = 0xFFFFFFFF;
    bytes_.resize(bytes_.find_last_not_of('\0') + 1);
    return std::exchange(bytes_, {});
  }

 private:
  std::uint32_t low_ = 0;
  std::uint32_t high_ = 0xFFFFFFFF;
  std::string bytes_;
};

class RangeDecoder {
 public:
  static constexpr bool kIsEncoder = false;

  // Requires: `bytes` outlives the decoder.
  explicit RangeDecoder(std::string_view bytes) : bytes_(bytes) {
    for (std::size_t i = 0; i < kBytesAhead; ++i) code_ = code_ << 8 | NextByte();
  }

  // Returns the next bit. Ignores the first argument, which only the encoder uses.
  int Code(int, int probability) {
    const std::uint32_t middle = low_ + static_cast<std::uint32_t>((static_cast<std::uint64_t>(high_ - low_) *
                                                                    static_cast<std::uint32_t>(probability)) >>
                                                                   kProbabilityBits);
    const int bit = code_ <= middle ? 1 : 0;
    if (bit != 0) {
      high_ = middle;
    } else {
      low_ = middle + 1;
    }
    while (((low_ ^ high_) >> 24) == 0) {
      low_ <<= 8;
      high_ = high_ << 8 | 0xFF;
      code_ = code_ << 8 | NextByte();
    }
    return bit;
  }

  // False if the input has more bytes than the encoder writes for the bits that were decoded.
  bool IsAtEnd() const { return bytes_.size() <= next_ - kBytesAhead + 1; }

 private:
  static constexpr std::size_t kBytesAhead = 4;

  std::uint32_t NextByte() {
    const std::size_t at = next_++;
    return at < bytes_.size() ? static_cast<unsigned char>(bytes_[at]) : 0u;
  }

  std::string_view bytes_;
  std::size_t next_ = 0;
  std::uint32_t low_ = 0;
  std::uint32_t high_ = 0xFFFFFFFF;
  std::uint32_t code_ = 0;
};

}  // namespace moondb
