#include "actors/sharing/coding/bit_model.h"

namespace moondb {

namespace {

constexpr int kCountLimit = 250;
constexpr int kLearningShift = 16;   // Of weights.
constexpr int kWeightMax = 1 << 23;  // 128: far beyond what is of use, so that no input overflows.
constexpr int kBiasLogit = 256;      // The last input, always the same.
constexpr int kMixedMax = 3000;      // Logits; beyond what Squash tells apart.
constexpr int kRareShift = 9;        // They adapt by 1/512,
constexpr int kRefinementShift = 6;  // the last table by 1/64.
constexpr int kFinalMin = 24;        // No bit costs more than 12 bits,
constexpr int kRareMin = 3;          // or 15 where it is nearly certain.
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
constexpr std::uint32_t kWeightsAlone = kDecisionCount * kSetsPerDecision * (kModelsAlone + 1);
constexpr std::uint32_t kWeightsWithPrevious = kDecisionCount * kSetsPerDecision * (kModelsWithPrevious + 1);

// 1 / (count + 1.6), of kProbabilityOne.
constexpr std::array<std::int32_t, BitModel::kCountMax + 1> MakeRates() {
  std::array<std::int32_t, BitModel::kCountMax + 1> rates{};
  for (std::size_t i = 0; i < rates.size(); ++i) {
    rates[i] = static_cast<std::int32_t>(kProbabilityOne * 5 / (5 * i + 8));
  }
  return rates;
}

constexpr std::array<std::int32_t, BitModel::kCountMax + 1> kRates = MakeRates();

int Target(int bit) { return bit != 0 ? kProbabilityOne - 1 : 0; }

}  // namespace

BitModel::BitModel()
    : slots_(kDecisionCount * kSlotsPerDecision),
      weights_(kWeightsAlone + kWeightsWithPrevious, kProbabilityOne * 3 / 10),
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
    last_.inputs[i] = Stretch(slots_[last_.slots[i]].p);
  }
  last_.inputs[kModels] = kBiasLogit;
  const std::uint32_t base = (kModels == kModelsAlone ? 0 : kWeightsAlone);
  std::uint32_t set = table * kSetsPerDecision;
  for (std::size_t choice = 0; choice < kChoiceCount; ++choice) {
    last_.weights[choice] = base + (set + contexts.weight_sets[choice]) * static_cast<std::uint32_t>(kModels + 1);
    set += kWeightSetCounts[choice];
    const std::int32_t* weights = weights_.data() + last_.weights[choice];
    std::int64_t sum = 0;
    for (std::size_t i = 0; i <= kModels; ++i) sum += static_cast<std::int64_t>(weights[i]) * last_.inputs[i];
    last_.mixed[choice] = static_cast<std::int32_t>(std::clamp<std::int64_t>(sum >> 16, -kMixedMax, kMixedMax));
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
    const std::int32_t error = (bit << kProbabilityBits) - Squash(last_.mixed[choice]);
    std::int32_t* weights = weights_.data() + last_.weights[choice];
    for (std::size_t i = 0; i <= kModels; ++i) {
      const std::int32_t step = (last_.inputs[i] * error + (1 << (kLearningShift - 1))) >> kLearningShift;
      weights[i] = std::clamp(weights[i] + step, -kWeightMax, kWeightMax);
    }
  }
  for (std::size_t i = 0; i < kModels; ++i) {
    Slot& slot = slots_[last_.slots[i]];
    const std::int64_t step = static_cast<std::int64_t>(Target(bit) - slot.p) * kRates[slot.count];
    slot.p = static_cast<std::uint16_t>(slot.p + step / kProbabilityOne);
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
