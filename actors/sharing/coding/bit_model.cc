#include "actors/sharing/coding/bit_model.h"

namespace moondb {

namespace {

constexpr std::uint32_t kCountLimit = 250;
constexpr int kLearningShift = 15;          // The learning rate of the weights is 2^-15.
constexpr std::int16_t kWeightMax = 30000;  // Limits the weights, which would overflow otherwise.
constexpr int kRareShift = 9;               // Adaptation rate of the probabilities of rare bits: 1/512.
constexpr int kRareMin = 3;                 // Lowest probability of rare bits, so none costs more than 15 bits.

// Returns the weight plus input * error / 2^kLearningShift, rounded, and limited to the range of +-kWeightMax.
std::int16_t Moved(std::int16_t weight, std::int16_t input, std::int16_t error) {
  static_assert(kLearningShift == 15);
  const std::int16_t twice = static_cast<std::int16_t>(2 * input);
  const std::int16_t high = static_cast<std::int16_t>((twice * error) >> 16);
  const std::uint16_t low =
      static_cast<std::uint16_t>(1u * static_cast<std::uint16_t>(twice) * static_cast<std::uint16_t>(error));
  const std::int16_t moved = static_cast<std::int16_t>(weight + high + (low >> 15));
  return std::min(std::max(moved, static_cast<std::int16_t>(-kWeightMax)), kWeightMax);
}

}  // namespace

BitModel::BitModel()
    : slots_(kDecisionCount * (kSlotOffsets.back() + kContextCounts.back())),
      weights_(2 * kDecisionCount * (kWeightSetCounts[0] + kWeightSetCounts[1]) * kInputs, (1 << kWeightBits) * 3 / 10),
      refinements_(2 * kDecisionCount * kRefinementCount * kRefinementKnots),
      count_limit_(kCountLimit) {
  rare_.fill(kProbabilityOne / 64);
  for (std::size_t i = 0; i < refinements_.size(); ++i) {
    const int knot = static_cast<int>(i % kRefinementKnots);
    refinements_[i] = static_cast<std::uint16_t>(Squash(knot * static_cast<int>(kRefinementStep) - kRefinementMax));
  }
}

void BitModel::UpdateRare(Decision decision, int bit) {
  std::uint16_t& p = rare_[static_cast<std::size_t>(decision)];
  const int target = bit != 0 ? kProbabilityOne - 1 : 0;
  const int moved = p + ((target - p) >> kRareShift);
  p = static_cast<std::uint16_t>(std::clamp(moved, kRareMin, kProbabilityOne - kRareMin));
}

// The functions below are not in the header, because compilers vectorise these loops well only in separate functions.

BitModel::Sums BitModel::Multiply(const Inputs& inputs, const std::int16_t* first, const std::int16_t* second) {
  const std::int16_t* input = reinterpret_cast<const std::int16_t*>(inputs.data());
  Sums sums{0, 0};
  for (std::size_t i = 0; i < kInputs; ++i) sums.first += input[i] * first[i];
  for (std::size_t i = 0; i < kInputs; ++i) sums.second += input[i] * second[i];
  return sums;
}

void BitModel::Adjust(const Inputs& inputs, Errors errors, std::int16_t* first, std::int16_t* second) {
  const std::int16_t* input = reinterpret_cast<const std::int16_t*>(inputs.data());
  // Collect the results in separate arrays: storing a weight between the loads would prevent vectorisation.
  std::array<std::int16_t, kInputs> first_moved, second_moved;
  for (std::size_t i = 0; i < kInputs; ++i) {
    first_moved[i] = Moved(first[i], input[i], errors.first);
    second_moved[i] = Moved(second[i], input[i], errors.second);
  }
  for (std::size_t i = 0; i < kInputs; ++i) first[i] = first_moved[i];
  for (std::size_t i = 0; i < kInputs; ++i) second[i] = second_moved[i];
}

}  // namespace moondb
