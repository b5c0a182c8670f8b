// BitModel: foretells one bit at a time by mixing what several contexts have seen (logistic mixing, as in PAQ).
//
// Each context model holds a probability for each of its contexts, with a count of what it has seen: the more, the
// slower it adapts. Their logits are mixed by two sets of weights, each chosen by a context of its own; the mean of the
// two is refined by a last table; and everything learns from the bit. Whole numbers only.
//
// There are two decisions a cell, with tables of their own, and each is made with or without a previous map, with
// weights of their own. A run's model begins as a copy of TrainedModel() (trained_tables.h): what it holds is part of
// the wire format, and so is every number here. 1 MB. Not thread-safe.
//
// Most of the time to code a map goes into Predict and Update. They are here to become part of the loop over its cells,
// so that contexts need not go through memory.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "actors/sharing/coding/logistic.h"

namespace moondb {

enum class Decision { kIsKnown = 0, kIsHazard = 1 };

inline constexpr std::size_t kDecisionCount = 2;
inline constexpr std::size_t kModelsAlone = 10;
inline constexpr std::size_t kModelsWithPrevious = 14;
inline constexpr std::size_t kInputs = 16;      // Of a mixing: models, one that is always the same, and zeros.
inline constexpr std::size_t kChoiceCount = 2;  // Of weights.

// How many contexts each model has, each choice of weights, and the last table.
inline constexpr std::array<std::uint32_t, kModelsWithPrevious> kContextCounts = {
    2916, 11664, 4096, 10368, 3456, 11664, 13824, 3888, 2916, 8192, 5184, 5184, 8192, 6912};
inline constexpr std::array<std::uint32_t, kChoiceCount> kWeightSetCounts = {144, 256};
inline constexpr std::uint32_t kRefinementCount = 324;

// One decision's contexts, each below its count above. Without a previous map the first kModelsAlone models count.
struct BitContexts {
  Decision decision = Decision::kIsKnown;
  bool has_previous = false;
  std::array<std::uint32_t, kModelsWithPrevious> models{};
  std::array<std::uint32_t, kChoiceCount> weight_sets{};
  std::uint32_t refinement = 0;
};

class BitModel {
 public:
  // A context model's memory of one context, in one number: the probability above, the count below.
  class Slot {
   public:
    constexpr Slot() = default;
    constexpr Slot(int p, int count)
        : state_(static_cast<std::uint32_t>(p) << 16 | static_cast<std::uint32_t>(count)) {}
    std::uint32_t p() const { return state_ >> 16; }
    std::uint32_t count() const { return state_ & 0xFFFF; }
    // Moves the probability by `rate` / 2^16 of its distance from the bit; what it becomes is rounded down.
    void MoveTo(int bit, std::uint32_t rate) {
      const std::uint32_t product = bit != 0 ? (0xFFFF - p()) * rate : p() * rate + 0xFFFF;
      const std::uint32_t step = product & 0xFFFF0000;
      state_ = bit != 0 ? state_ + step : state_ - step;
    }
    void Count(std::uint32_t limit) { state_ += count() < limit ? 1 : 0; }

   private:
    std::uint32_t state_ = (kProbabilityOne / 2) << 16;
  };

  // Knows nothing.
  BitModel();

  // The probability that the next bit of a decision is 1; for Update of the same model alone.
  struct Prediction;
  Prediction Predict(const BitContexts& contexts);
  // What the bit was. Comes before that decision's next Predict; the other decision's may come between.
  void Update(const Prediction& prediction, int bit);

  // For bits that are nearly certain: one adaptive probability for all of them, without mixing.
  int PredictRare(Decision decision) const { return rare_[static_cast<std::size_t>(decision)]; }
  void UpdateRare(Decision decision, int bit);

  // Contexts that have seen so much adapt no slower; at most kCountMax. Learning takes more than coding.
  void SetCountLimit(std::uint32_t limit) { count_limit_ = limit; }

  // What learnt tables hold: all slots, all weights in 1/16384, the probabilities of rare bits.
  std::vector<Slot>& slots() { return slots_; }
  std::vector<std::int16_t>& weights() { return weights_; }
  std::array<std::uint16_t, kDecisionCount>& rare() { return rare_; }

  static constexpr std::uint32_t kCountMax = 1000;

 private:
  using Lanes __attribute__((vector_size(16))) = std::int16_t;  // Eight inputs or weights at once.
  using Inputs = std::array<Lanes, kInputs / 8>;

  static constexpr int kWeightBits = 14;
  static constexpr int kErrorShift = 2;       // So that an error fits 16 bits.
  static constexpr int kBiasLogit = 256;      // The last input, always the same.
  static constexpr int kRefinementShift = 6;  // The last table adapts by 1/64.
  static constexpr int kFinalMin = 24;        // No bit costs more than 12 bits.
  static constexpr std::uint32_t kRefinementKnots = 33;
  static constexpr std::uint32_t kRefinementStep = 128;  // Logits between two knots.
  static constexpr int kRefinementMax = kRefinementStep * (kRefinementKnots - 1) / 2;

  // 1 / (count + 1.6), in 1/2^16; its last two bits are zeros.
  static constexpr std::array<std::uint16_t, kCountMax + 1> MakeRates() {
    std::array<std::uint16_t, kCountMax + 1> rates{};
    for (std::size_t i = 0; i < rates.size(); ++i) {
      rates[i] = static_cast<std::uint16_t>((5u << 14) / (5 * i + 8) << 2);
    }
    return rates;
  }
  static constexpr std::array<std::uint32_t, kModelsWithPrevious> MakeSlotOffsets() {
    std::array<std::uint32_t, kModelsWithPrevious> offsets{};
    for (std::size_t i = 1; i < offsets.size(); ++i) offsets[i] = offsets[i - 1] + kContextCounts[i - 1];
    return offsets;
  }
  static const std::array<std::uint16_t, kCountMax + 1> kRates;
  static const std::array<std::uint32_t, kModelsWithPrevious> kSlotOffsets;

  // Of both sets of weights.
  struct Sums {
    std::int32_t first, second;
  };
  struct Errors {
    std::int16_t first, second;
  };
  static Sums Multiply(const Inputs& inputs, const std::int16_t* first, const std::int16_t* second);
  static void Adjust(const Inputs& inputs, Errors errors, std::int16_t* first, std::int16_t* second);
  template <std::size_t kModels>
  Prediction Mix(const BitContexts& contexts);
  template <std::size_t kModels>
  void Learn(const Prediction& made, int bit);

  std::vector<Slot> slots_;            // [decision][model][context]
  std::vector<std::int16_t> weights_;  // Alone, then with a previous map: [decision][choice][set][input]
  std::vector<std::uint16_t> refinements_;
  std::array<std::uint16_t, kDecisionCount> rare_;
  std::uint32_t count_limit_;
};

// A probability, and the places in the model's tables that it was made from.
struct BitModel::Prediction {
  int probability;
  bool has_previous;
  std::array<Slot*, kModelsWithPrevious> slots;
  Inputs inputs;
  std::array<std::int16_t*, kChoiceCount> weights;
  std::array<std::int32_t, kChoiceCount> mixed;
  std::uint16_t* refinement;
};

inline constexpr std::array<std::uint16_t, BitModel::kCountMax + 1> BitModel::kRates = BitModel::MakeRates();
inline constexpr std::array<std::uint32_t, kModelsWithPrevious> BitModel::kSlotOffsets = BitModel::MakeSlotOffsets();

template <std::size_t kModels>
[[gnu::always_inline]] inline BitModel::Prediction BitModel::Mix(const BitContexts& contexts) {
  constexpr std::uint32_t kSlotsPerDecision = kSlotOffsets.back() + kContextCounts.back();
  constexpr std::uint32_t kSetsPerDecision = kWeightSetCounts[0] + kWeightSetCounts[1];
  const std::uint32_t decision = static_cast<std::uint32_t>(contexts.decision);
  const std::uint32_t table = (contexts.has_previous ? kDecisionCount : 0) + decision;
  Prediction made;
  made.has_previous = contexts.has_previous;
  Slot* const slots = slots_.data() + decision * kSlotsPerDecision;
  const auto input = [&](std::size_t i) {
    if (i >= kModels) return static_cast<std::int16_t>(i == kModels ? kBiasLogit : 0);
    made.slots[i] = slots + kSlotOffsets[i] + contexts.models[i];
    return static_cast<std::int16_t>(Stretch(static_cast<int>(made.slots[i]->p())));
  };
  // As whole vectors: numbers that were written one by one are slow to be read together.
  made.inputs[0] = Lanes{input(0), input(1), input(2), input(3), input(4), input(5), input(6), input(7)};
  made.inputs[1] = Lanes{input(8), input(9), input(10), input(11), input(12), input(13), input(14), input(15)};
  std::int16_t* const sets = weights_.data() + table * kSetsPerDecision * kInputs;
  made.weights[0] = sets + contexts.weight_sets[0] * kInputs;
  made.weights[1] = sets + (kWeightSetCounts[0] + contexts.weight_sets[1]) * kInputs;
  const Sums sums = Multiply(made.inputs, made.weights[0], made.weights[1]);
  made.mixed[0] = std::clamp(sums.first >> kWeightBits, -kSquashMax, kSquashMax);
  made.mixed[1] = std::clamp(sums.second >> kWeightBits, -kSquashMax, kSquashMax);
  const int logit = (made.mixed[0] + made.mixed[1]) >> 1;
  // Between the two knots of the last table that are nearest.
  const std::uint32_t place =
      static_cast<std::uint32_t>(std::clamp(logit, -kRefinementMax, kRefinementMax - 1) + kRefinementMax);
  const std::uint32_t share = place % kRefinementStep;
  std::uint16_t* const knots = refinements_.data() +
                               (table * kRefinementCount + contexts.refinement) * kRefinementKnots +
                               place / kRefinementStep;
  made.refinement = knots + (2 * share >= kRefinementStep ? 1 : 0);
  const std::uint32_t refined = (knots[0] * (kRefinementStep - share) + knots[1] * share) / kRefinementStep;
  made.probability =
      std::clamp((Squash(logit) + static_cast<int>(refined)) / 2, kFinalMin, kProbabilityOne - kFinalMin);
  return made;
}

template <std::size_t kModels>
[[gnu::always_inline]] inline void BitModel::Learn(const Prediction& made, int bit) {
  const auto error = [bit](int mixed) {
    return static_cast<std::int16_t>(((bit << kProbabilityBits) - Squash(mixed)) / (1 << kErrorShift));
  };
  Adjust(made.inputs, {error(made.mixed[0]), error(made.mixed[1])}, made.weights[0], made.weights[1]);
  for (std::size_t i = 0; i < kModels; ++i) {
    Slot slot = *made.slots[i];
    slot.MoveTo(bit, kRates[slot.count()]);
    slot.Count(count_limit_);
    *made.slots[i] = slot;
  }
  std::uint16_t& refined = *made.refinement;
  const int target = bit != 0 ? kProbabilityOne - 1 : 0;
  refined = static_cast<std::uint16_t>(refined + (target - refined) / (1 << kRefinementShift));
}

[[gnu::always_inline]] inline BitModel::Prediction BitModel::Predict(const BitContexts& contexts) {
  return contexts.has_previous ? Mix<kModelsWithPrevious>(contexts) : Mix<kModelsAlone>(contexts);
}

[[gnu::always_inline]] inline void BitModel::Update(const Prediction& prediction, int bit) {
  prediction.has_previous ? Learn<kModelsWithPrevious>(prediction, bit) : Learn<kModelsAlone>(prediction, bit);
}

}  // namespace moondb
