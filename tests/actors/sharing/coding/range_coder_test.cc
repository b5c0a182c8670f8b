#include "actors/sharing/coding/range_coder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace moondb {
namespace {

struct Bit {
  int bit = 0;
  int probability = 0;
};

std::string Encode(const std::vector<Bit>& bits) {
  RangeEncoder encoder;
  for (const Bit& bit : bits) encoder.Code(bit.bit, bit.probability);
  return encoder.Finish();
}

TEST(RangeCoderTest, RestoresEveryBit) {
  const unsigned seed = 11;
  SCOPED_TRACE(seed);
  std::mt19937 rng(seed);
  for (int round = 0; round < 2000; ++round) {
    std::vector<Bit> bits(rng() % 300);
    const int kind = static_cast<int>(rng() % 3);
    for (Bit& bit : bits) {
      bit.probability = kind == 0 ? 1 + static_cast<int>(rng() % 65535) : kind == 1 ? 1 : 65535;
      bit.bit = static_cast<int>(rng() % 2);
    }
    const std::string bytes = Encode(bits);
    RangeDecoder decoder(bytes);
    for (const Bit& bit : bits) ASSERT_EQ(decoder.Code(0, bit.probability), bit.bit) << round;
    EXPECT_TRUE(decoder.IsAtEnd()) << round;
  }
}

TEST(RangeCoderTest, CodesWithinAPercentOfTheEntropy) {
  const unsigned seed = 12;
  SCOPED_TRACE(seed);
  std::mt19937 rng(seed);
  std::vector<Bit> bits(100'000);
  double entropy_bits = 0;
  for (Bit& bit : bits) {
    bit.probability = 1 + static_cast<int>(rng() % 65535);
    bit.bit = static_cast<int>(rng() % 65536) < bit.probability ? 1 : 0;
    const double p = bit.probability / 65536.0;
    entropy_bits -= std::log2(bit.bit != 0 ? p : 1 - p);
  }
  EXPECT_LT(static_cast<double>(Encode(bits).size()), entropy_bits / 8 * 1.01);
}

TEST(RangeCoderTest, WritesNoBytesForExpectedBits) {
  EXPECT_EQ(Encode(std::vector<Bit>(1000, Bit{1, 65535})).size(), 0u);
  EXPECT_LE(Encode(std::vector<Bit>(1000, Bit{0, 1})).size(), 1u);
}

TEST(RangeCoderTest, RestartsAfterFinish) {
  RangeEncoder encoder;
  const auto code = [&encoder] {
    for (int i = 0; i < 50; ++i) encoder.Code(i % 3 == 0 ? 1 : 0, 20000);
    return encoder.Finish();
  };
  const std::string first = code();
  EXPECT_EQ(code(), first);
}

TEST(RangeCoderTest, DetectsBytesAfterTheEnd) {
  std::vector<Bit> bits(400, Bit{0, 30000});
  const std::string bytes = Encode(bits) + "more";
  RangeDecoder decoder(bytes);
  for (const Bit& bit : bits) decoder.Code(0, bit.probability);
  EXPECT_FALSE(decoder.IsAtEnd());
}

TEST(RangeCoderTest, ReadsZerosAfterTheEnd) {
  RangeDecoder decoder("");
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(decoder.Code(0, 30000), 1);
}

}  // namespace
}  // namespace moondb
