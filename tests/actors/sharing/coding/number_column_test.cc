#include "actors/sharing/coding/number_column.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>
#include <random>

namespace moondb {
namespace {

using Numbers = std::vector<std::uint64_t>;

std::string EncodeColumn(const Numbers& numbers) {
  std::string bytes;
  PutColumn(numbers, bytes);
  return bytes;
}

void ExpectColumnRoundTrip(const Numbers& numbers) {
  const std::string bytes = EncodeColumn(numbers);
  ByteReader reader(bytes);
  EXPECT_EQ(TakeColumn(numbers.size(), reader), numbers);
  EXPECT_TRUE(reader.is_good());
  EXPECT_TRUE(reader.IsAtEnd());
}

TEST(NumberColumnTest, RestoresEveryNumber) {
  const unsigned seed = 21;
  SCOPED_TRACE(seed);
  std::mt19937_64 rng(seed);
  ExpectColumnRoundTrip({});
  for (int round = 0; round < 2000; ++round) {
    Numbers numbers(1 + rng() % 60);
    const int bits = static_cast<int>(rng() % 64) + 1;
    std::uint64_t last = rng();
    for (std::uint64_t& number : numbers) {
      last = round % 2 == 0 ? rng() >> (64 - bits) : last + (rng() >> (64 - bits));
      number = last;
    }
    ExpectColumnRoundTrip(numbers);
  }
}

TEST(NumberColumnTest, RestoresTheExtremes) {
  const std::uint64_t most = std::numeric_limits<std::uint64_t>::max();
  ExpectColumnRoundTrip({0, most, 0, most, most / 2, most / 2 + 1, 0, 1});
}

TEST(NumberColumnTest, RestoresDoublesBitForBit) {
  Numbers numbers;
  for (const double value : {0.0, -0.0, 1.5, std::numeric_limits<double>::infinity(), -1e-310, 3.25}) {
    numbers.push_back(std::bit_cast<std::uint64_t>(value));
  }
  for (const std::uint64_t nan : {0x7FF8000000000001u, 0xFFF8DEADBEEF0001u, 0x7FF0000000000001u})
    numbers.push_back(nan);
  ExpectColumnRoundTrip(numbers);
}

TEST(NumberColumnTest, NeedsFewBytesForConstantOrEvenlyGrowingNumbers) {
  Numbers even, same;
  for (std::uint64_t i = 0; i < 1000; ++i) {
    even.push_back(1'700'000'000'000'000'000u + i * 100'000'000);
    same.push_back(77);
  }
  EXPECT_LT(EncodeColumn(same).size(), 8u);
  const std::string bytes = EncodeColumn(even);
  EXPECT_GT(std::count(bytes.begin(), bytes.end(), '\0'), static_cast<std::ptrdiff_t>(bytes.size()) - 20);
}

TEST(NumberColumnTest, RefusesEveryTruncation) {
  const Numbers numbers = {5, 900, 17, 1u << 30, 6};
  const std::string bytes = EncodeColumn(numbers);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    ByteReader reader(std::string_view(bytes).substr(0, size));
    TakeColumn(numbers.size(), reader);
    EXPECT_FALSE(reader.is_good()) << size;
  }
}

TEST(NumberColumnTest, RefusesAnUnknownMethodAndWidth) {
  for (const std::string& bytes : {std::string("\x03\x00\x00", 3), std::string("\x00\x00\x09\0\0\0\0\0\0\0\0\0", 12)}) {
    ByteReader reader(bytes);
    TakeColumn(2, reader);
    EXPECT_FALSE(reader.is_good());
  }
}

TEST(NumberColumnTest, RefusesAVarintThatIsNotTheShortest) {
  ByteReader reader(std::string_view("\x81\x00", 2));
  reader.Varint();
  EXPECT_FALSE(reader.is_good());
}

}  // namespace
}  // namespace moondb
