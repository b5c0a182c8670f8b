// Appends numbers to bytes in little-endian order.
#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <type_traits>

namespace moondb {

template <typename Number>
void AppendLittleEndian(Number value, std::string& bytes) {
  using Bits =
      std::conditional_t<sizeof(Number) == 8, std::uint64_t,
                         std::conditional_t<sizeof(Number) == 4, std::uint32_t,
                                            std::conditional_t<sizeof(Number) == 2, std::uint16_t, std::uint8_t>>>;
  const auto bits = std::bit_cast<Bits>(value);
  for (std::size_t i = 0; i < sizeof(Number); ++i) bytes.push_back(static_cast<char>(bits >> (8 * i)));
}

}  // namespace moondb
