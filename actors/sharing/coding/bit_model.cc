#include "actors/sharing/coding/bit_model.h"

namespace moondb {

namespace {

constexpr int kCountLimit = 250;
constexpr int kWeightBits = 14;
constexpr int kErrorShift = 2;              // So that an error fits 16 bits.
constexpr int kLearningShift = 15;          // Of weights.
constexpr std::int16_t kWeightMax = 30000;  // So that none overflows.
constexpr int kBiasLogit = 256;             // The last input, always the same.
constexpr int kMixedMax = 3000;             // Logits; beyond what Squash tells apart.
constexpr int kRareShift = 9;               // They adapt by 1/512,
constexpr int kRefinementShift = 6;         // the last table by 1/64.
constexpr int kFinalMin = 24;               // No bit costs more than 12 bits,
constexpr int kRareMin = 3;                 // or 15 where it is nearly certain.
constexpr std::uint32_t kRefinementKnots = 33;
constexpr int kRefinementStep = 128;  // Logits between two knots.
constexpr int kRefinementMax = kRefinementStep * (static_cast<int>(kRefinementKnots) - 1) / 2;

constexpr std::array<std::uint32_t, kModelsWithPrevious> MakeSlotOffsets() {
  std::array<std::uint32_t, kModelsWithPrevious> offsets{};
  for (std::size_t i = 1; i < offsets.size(); ++i) offsets[i] = offsets[i - 1] + kContextCounts[i - 1];
  return offsets;
}

constexpr std::array<std::uint32_t, kModelsWithPrevious> kSlotOffsets = MakeSlotOffsets();
constexpr std::uint32_t kSlotsPerDecision = kSlotOffsets.back() + kContextCounts.back();
constexpr std::uint32_t kSetsPerDecision = kWeightSetCounts[0] + kWeightSetCounts[1];
constexpr std::uint32_t kWeightsPerMode = kDecisionCount * kSetsPerDecision * kInputs;

constexpr int kRateBits = 14;

// 1 / (count + 1.6), in 1/2^kRateBits.
constexpr std::array<std::int32_t, BitModel::kCountMax + 1> MakeRates() {
  std::array<std::int32_t, BitModel::kCountMax + 1> rates{};
  for (std::size_t i = 0; i < rates.size(); ++i) {
    rates[i] = static_cast<std::int32_t>((5u << kRateBits) / (5 * i + 8));
  }
  return rates;
}

constexpr std::array<std::int32_t, BitModel::kCountMax + 1> kRates = MakeRates();

// Plain loops over 16 short numbers, which compilers turn into a few instructions.
std::int32_t Sum(const std::int16_t* inputs, const std::int16_t* weights) {
  std::int32_t sum = 0;
  for (std::size_t i = 0; i < kInputs; ++i) sum += inputs[i] * weights[i];
  return sum;
}

void Adjust(const std::int16_t* inputs, std::int16_t error, std::int16_t* weights) {
  std::array<std::int16_t, kInputs> moved;  // Apart from the weights, so that no store is in a load's way.
  for (std::size_t i = 0; i < kInputs; ++i) {
    const std::int32_t step = (inputs[i] * error + (1 << (kLearningShift - 1))) >> kLearningShift;
    moved[i] = static_cast<std::int16_t>(weights[i] + step);
  }
  for (std::size_t i = 0; i < kInputs; ++i) {
    const std::int16_t least = moved[i] < -kWeightMax ? static_cast<std::int16_t>(-kWeightMax) : moved[i];
    weights[i] = least > kWeightMax ? kWeightMax : least;
  }
}

int Target(int bit) { return bit != 0 ? kProbabilityOne - 1 : 0; }

}  // namespace

BitModel::BitModel()
    : slots_(kDecisionCount * kSlotsPerDecision),
      weights_(2 * kWeightsPerMode, (1 << kWeightBits) * 3 / 10),
      refinements_(2 * kDecisionCount * kRefinementCount * kRefinementKnots),
      count_limit_(kCountLimit) {
  rare_.fill(kProbabilityOne / 64);
  for (std::size_t i = 0; i < refinements_.size(); ++i) {
    const int knot = static_cast<int>(i % kRefinementKnots);
    refinements_[i] = static_cast<std::uint16_t>(Squash(knot * kRefinementStep - kRefinementMax));
  }
}

void BitModel::UpdateRare(Decision decision, int bit) {
  std::uint16_t& p = rare_[static_cast<std::size_t>(decision)];
  const int moved = p + ((Target(bit) - p) >> kRareShift);
  p = static_cast<std::uint16_t>(std::clamp(moved, kRareMin, kProbabilityOne - kRareMin));
}

template <std::size_t kModels>
int BitModel::Mix(const BitContexts& contexts) {
  const std::uint32_t table = static_cast<std::uint32_t>(contexts.decision);
  last_.has_previous = contexts.has_previous;
  for (std::size_t i = 0; i < kModels; ++i) {
    last_.slots[i] = table * kSlotsPerDecision + kSlotOffsets[i] + contexts.models[i];
    last_.inputs[i] = static_cast<std::int16_t>(Stretch(slots_[last_.slots[i]].p));
  }
  last_.inputs[kModels] = kBiasLogit;
  std::fill(last_.inputs.begin() + kModels + 1, last_.inputs.end(), std::int16_t{0});
  std::uint32_t set = (contexts.has_previous ? kDecisionCount : 0) * kSetsPerDecision + table * kSetsPerDecision;
  for (std::size_t choice = 0; choice < kChoiceCount; ++choice) {
    last_.weights[choice] = (set + contexts.weight_sets[choice]) * static_cast<std::uint32_t>(kInputs);
    set += kWeightSetCounts[choice];
    const std::int32_t sum = Sum(last_.inputs.data(), weights_.data() + last_.weights[choice]);
    last_.mixed[choice] = std::clamp(sum >> kWeightBits, -kMixedMax, kMixedMax);
  }
  const int logit = (last_.mixed[0] + last_.mixed[1]) >> 1;
  // Between the two knots of the last table that are nearest.
  const int place = std::clamp(logit, -kRefinementMax, kRefinementMax - 1) + kRefinementMax;
  const std::uint32_t knot = static_cast<std::uint32_t>(place / kRefinementStep);
  const int share = place % kRefinementStep;
  const std::uint32_t row = ((contexts.has_previous ? kDecisionCount : 0) + table) * kRefinementCount;
  const std::uint32_t first = (row + contexts.refinement) * kRefinementKnots + knot;
  last_.refinement = first + (2 * share >= kRefinementStep ? 1 : 0);
  const int refined =
      (refinements_[first] * (kRefinementStep - share) + refinements_[first + 1] * share) / kRefinementStep;
  return std::clamp((Squash(logit) + refined) / 2, kFinalMin, kProbabilityOne - kFinalMin);
}

template <std::size_t kModels>
void BitModel::Learn(int bit) {
  for (std::size_t choice = 0; choice < kChoiceCount; ++choice) {
    const int error = ((bit << kProbabilityBits) - Squash(last_.mixed[choice])) / (1 << kErrorShift);
    Adjust(last_.inputs.data(), static_cast<std::int16_t>(error), weights_.data() + last_.weights[choice]);
  }
  for (std::size_t i = 0; i < kModels; ++i) {
    Slot& slot = slots_[last_.slots[i]];
    const std::int32_t step = (Target(bit) - slot.p) * kRates[slot.count];
    slot.p = static_cast<std::uint16_t>(slot.p + (step >> kRateBits));
    if (slot.count < count_limit_) ++slot.count;
  }
  std::uint16_t& refined = refinements_[last_.refinement];
  refined = static_cast<std::uint16_t>(refined + (Target(bit) - refined) / (1 << kRefinementShift));
}

int BitModel::Predict(const BitContexts& contexts) {
  return contexts.has_previous ? Mix<kModelsWithPrevious>(contexts) : Mix<kModelsAlone>(contexts);
}

void BitModel::Update(int bit) { last_.has_previous ? Learn<kModelsWithPrevious>(bit) : Learn<kModelsAlone>(bit); }

}  // namespace moondb
