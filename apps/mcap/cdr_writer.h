// CdrWriter: serialises a ROS 2 message as XCDR1 in little-endian order, with the header of the encapsulation
// (OMG Data Distribution Service Interoperability, "CDR_LE").
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "apps/mcap/little_endian.h"

namespace moondb {

class CdrWriter {
 public:
  // Appends a number, aligned to its size.
  template <typename Number>
  CdrWriter& Add(Number value) {
    Align(sizeof(Number));
    AppendLittleEndian(value, bytes_);
    return *this;
  }
  // Appends the length with the terminating zero, the text and the zero.
  CdrWriter& Add(std::string_view text) {
    Add(static_cast<std::uint32_t>(text.size() + 1));
    bytes_.append(text).push_back('\0');
    return *this;
  }
  // Appends the length of a sequence. The caller then appends the elements.
  CdrWriter& AddCount(std::size_t count) { return Add(static_cast<std::uint32_t>(count)); }
  CdrWriter& AddSequence(std::span<const std::int8_t> values) {
    AddCount(values.size());
    bytes_.append(reinterpret_cast<const char*>(values.data()), values.size());
    return *this;
  }

  std::string Take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t kHeaderBytes = 4;

  void Align(std::size_t size) {
    while ((bytes_.size() - kHeaderBytes) % size != 0) bytes_.push_back('\0');
  }

  std::string bytes_ = std::string("\x00\x01\x00\x00", kHeaderBytes);
};

}  // namespace moondb
