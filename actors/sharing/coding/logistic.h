// The logistic function and its inverse in integer arithmetic, so every compiler and processor computes the same bits.
//
// A logit is ln(p / (1 - p)) in units of 1/256. A probability p is the probability of a 1 bit, in units of 1/65536. The
// tables are computed at compile time from integers only.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace moondb {

inline constexpr int kProbabilityBits = 16;
inline constexpr int kProbabilityOne = 1 << kProbabilityBits;
inline constexpr int kLogitMax = 2815;   // A logit of 11: the probability of a 0 bit is one in 60,000.
inline constexpr int kSquashMax = 3000;  // Squash returns the same probability for all larger logits.

// Makes the table of probabilities for the logits -kSquashMax to kSquashMax.
constexpr std::array<std::uint16_t, 2 * kSquashMax + 1> MakeSquashTable() {
  constexpr std::uint64_t kOne = 1ull << 32;
  constexpr std::uint64_t kStep = 4278222805;  // e^(-1/256), in units of 1/2^32.
  std::array<std::uint16_t, 2 * kSquashMax + 1> table{};
  std::uint64_t power = kOne;  // e^(-logit/256), in units of 1/2^32.
  for (int logit = 0; logit <= kSquashMax; ++logit) {
    const std::uint64_t p = (kOne << kProbabilityBits) / (kOne + power);
    table[static_cast<std::size_t>(kSquashMax + logit)] = static_cast<std::uint16_t>(p);
    if (logit != 0)
      table[static_cast<std::size_t>(kSquashMax - logit)] = static_cast<std::uint16_t>(kProbabilityOne - p);
    if (logit < kLogitMax) power = (power * kStep) >> 32;
  }
  return table;
}

inline constexpr std::array<std::uint16_t, 2 * kSquashMax + 1> kSquashTable = MakeSquashTable();

// Returns the probability for a logit, from 1 to 65535. Accepts any logit.
constexpr int Squash(int logit) {
  return kSquashTable[static_cast<std::size_t>(std::clamp(logit, -kSquashMax, kSquashMax) + kSquashMax)];
}

inline constexpr int kStretchBits = 12;  // Bits of a probability that Stretch uses.

constexpr std::array<std::int16_t, 1 << kStretchBits> MakeStretchTable() {
  std::array<std::int16_t, 1 << kStretchBits> table{};
  int logit = -kLogitMax;
  for (std::size_t i = 0; i < table.size(); ++i) {
    const int middle = static_cast<int>((2 * i + 1) << (kProbabilityBits - kStretchBits - 1));
    while (logit < kLogitMax && Squash(logit) < middle) ++logit;
    table[i] = static_cast<std::int16_t>(logit);
  }
  return table;
}

inline constexpr std::array<std::int16_t, 1 << kStretchBits> kStretchTable = MakeStretchTable();

// Returns the logit of a probability from 0 to 65535.
constexpr int Stretch(int p) { return kStretchTable[static_cast<std::size_t>(p >> (kProbabilityBits - kStretchBits))]; }

}  // namespace moondb
