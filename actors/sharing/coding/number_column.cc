#include "actors/sharing/coding/number_column.h"

#include <array>
#include <bit>

namespace moondb {

namespace {

enum Way : std::uint64_t { kDifference = 0, kDifferenceOfDifference = 1, kXor = 2 };
constexpr std::size_t kWayCount = 3;

std::uint64_t Zigzag(std::uint64_t value) { return value << 1 ^ (0 - (value >> 63)); }
std::uint64_t Unzigzag(std::uint64_t value) { return value >> 1 ^ (0 - (value & 1)); }

// Codes or decodes the numbers of a column in order. Unsigned arithmetic wraps around, so the difference of any two
// numbers is defined.
struct ColumnWalk {
  std::uint64_t last = 0;
  std::uint64_t last_difference = 0;

  std::uint64_t Left(Way way, std::uint64_t number) {
    const std::uint64_t difference = number - last;
    std::uint64_t left = Zigzag(difference);
    if (way == kDifferenceOfDifference) left = Zigzag(difference - last_difference);
    if (way == kXor) left = number ^ last;
    last = number;
    last_difference = difference;
    return left;
  }

  std::uint64_t Number(Way way, std::uint64_t left) {
    if (way == kXor) {
      last ^= left;
      return last;
    }
    last_difference = way == kDifferenceOfDifference ? last_difference + Unzigzag(left) : Unzigzag(left);
    last += last_difference;
    return last;
  }
};

Way BestWay(const std::vector<std::uint64_t>& numbers) {
  std::array<std::uint64_t, kWayCount> bits{};
  ColumnWalk walk{numbers.front(), 0};
  for (std::size_t i = 1; i < numbers.size(); ++i) {
    const std::uint64_t difference = numbers[i] - walk.last;
    bits[kDifference] += static_cast<std::uint64_t>(std::bit_width(Zigzag(difference)));
    bits[kDifferenceOfDifference] +=
        static_cast<std::uint64_t>(std::bit_width(Zigzag(difference - walk.last_difference)));
    bits[kXor] += static_cast<std::uint64_t>(std::bit_width(numbers[i] ^ walk.last));
    walk = {numbers[i], difference};
  }
  std::size_t best = 0;
  for (std::size_t way = 1; way < kWayCount; ++way) {
    if (bits[way] < bits[best]) best = way;
  }
  return static_cast<Way>(best);
}

}  // namespace

void PutColumn(const std::vector<std::uint64_t>& numbers, std::string& bytes) {
  if (numbers.empty()) return;
  const Way way = BestWay(numbers);
  ColumnWalk walk{numbers.front(), 0};
  std::vector<std::uint64_t> left;
  left.reserve(numbers.size());
  std::uint64_t all = 0;
  for (std::size_t i = 1; i < numbers.size(); ++i) {
    left.push_back(walk.Left(way, numbers[i]));
    all |= left.back();
  }
  const std::size_t width = static_cast<std::size_t>(std::bit_width(all) + 7) / 8;
  PutVarint(way, bytes);
  PutVarint(numbers.front(), bytes);
  PutVarint(width, bytes);
  std::size_t at = bytes.size();
  bytes.resize(at + width * left.size());
  for (std::size_t plane = 0; plane < width; ++plane) {
    for (const std::uint64_t value : left) bytes[at++] = static_cast<char>(value >> (8 * plane));
  }
}

std::vector<std::uint64_t> TakeColumn(std::size_t count, ByteReader& reader) {
  if (count == 0) return {};
  const std::uint64_t way = reader.Varint();
  ColumnWalk walk{reader.Varint(), 0};
  const std::uint64_t width = reader.Varint();
  if (way >= kWayCount || width > sizeof(std::uint64_t)) reader.Fail();
  const std::string_view planes = reader.Bytes(width * (count - 1));
  if (!reader.is_good()) return {};
  std::vector<std::uint64_t> numbers(count);
  for (std::size_t plane = 0; plane < width; ++plane) {
    const char* bytes = planes.data() + plane * (count - 1);
    for (std::size_t i = 1; i < count; ++i) {
      numbers[i] |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes[i - 1])) << (8 * plane);
    }
  }
  numbers[0] = walk.last;
  for (std::size_t i = 1; i < count; ++i) numbers[i] = walk.Number(static_cast<Way>(way), numbers[i]);
  return numbers;
}

}  // namespace moondb
