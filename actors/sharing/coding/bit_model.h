// BitModel: predicts one bit at a time from the statistics of several contexts (logistic mixing, as in PAQ).
//
// Each context model holds a probability for each of its contexts, and a count of the bits coded in this context. The
// probability adapts more slowly as the count grows. Two sets of weights, each selected by a context, mix the logits of
// all models. A refinement table corrects the mean of the two mixes. Probabilities, weights and table all learn from
// the coded bit. All arithmetic uses integers.
//
// Each cell is coded as two binary decisions, which have separate tables. Predictions with and without a previous map
// have separate weights. A run's model begins as a copy of TrainedModel() (trained_tables.h). The contents of
// TrainedModel() and every number in this file are part of the wire format. Takes 1 MB. Not thread-safe.
//
// Predict and Update take most of the time to code a map. They are in the header so the compiler can inline them.
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
inline constexpr std::size_t kInputs = 16;  // Inputs of a mix: one per model, a constant bias, and zeros as padding.
inline constexpr std::size_t kChoiceCount = 2;  // Number of mixes. Each mix selects one set of weights.

// Table sizes: the contexts of each model, the sets of weights of each mix, and the contexts of the refinement table.
inline constexpr std::array<std::uint32_t, kModelsWithPrevious> kContextCounts = {
    2916, 11664, 4096, 10368, 3456, 11664, 13824, 3888, 2916, 8192, 5184, 5184, 8192, 6912};
inline constexpr std::array<std::uint32_t, kChoiceCount> kWeightSetCounts = {144, 256};
inline constexpr std::uint32_t kRefinementCount = 324;

// Indexes of the contexts that one decision uses, one index into each table whose size is given above. Without a
// previous map, only the first kModelsAlone entries of `models` are used.
struct BitContexts {
  Decision decision = Decision::kIsKnown;
  bool has_previous = false;
  std::array<std::uint32_t, kModelsWithPrevious> models{};
  std::array<std::uint32_t, kChoiceCount> weight_sets{};
  std::uint32_t refinement = 0;
};

class BitModel {
 public:
  // The state of one context of a model in one number: the probability in the upper 16 bits, the count in the lower 16.
  class Slot {
   public:
    constexpr Slot() = default;
    constexpr Slot(int p, int count)
        : state_(static_cast<std::uint32_t>(p) << 16 | static_cast<std::uint32_t>(count)) {}
    std::uint32_t p() const { return state_ >> 16; }
    std::uint32_t count() const { return state_ & 0xFFFF; }
    // Moves the probability towards the bit by `rate` / 2^16 of their distance. The new probability is rounded down.
    void MoveTo(int bit, std::uint32_t rate) {
      const std::uint32_t product = bit != 0 ? (0xFFFF - p()) * rate : p() * rate + 0xFFFF;
      const std::uint32_t step = product & 0xFFFF0000;
      state_ = bit != 0 ? state_ + step : state_ - step;
    }
    void Count(std::uint32_t limit) { state_ += count() < limit ? 1 : 0; }

   private:
    std::uint32_t state_ = (kProbabilityOne / 2) << 16;
  };

  // Makes an untrained model.
  BitModel();

  // Predicts the probability that the next bit of a decision is 1. The result points into this model's tables and is
  // valid for Update of this model only.
  struct Prediction;
  Prediction Predict(const BitContexts& contexts);
  // Trains the model with the actual bit. Requires: after Predict returned `prediction`, Predict was not
  // called again for the same Decision. Calls of Predict for the other Decision are allowed.
  void Update(const Prediction& prediction, int bit);

  // Returns the probability that the next bit is 1, for a bit that is nearly certain. Each decision has one adaptive
  // probability for such bits, without mixing.
  int PredictRare(Decision decision) const { return rare_[static_cast<std::size_t>(decision)]; }
  void UpdateRare(Decision decision, int bit);

  // Sets the highest count of a context, at most kCountMax. From this count on, adaptation does not slow down further.
  // Training uses a higher limit than coding.
  void SetCountLimit(std::uint32_t limit) { count_limit_ = limit; }

  // The parts of the model that kTrainedTables stores: all slots, all weights in units of 1/16384, and the
  // probabilities of rare bits.
  std::vector<Slot>& slots() { return slots_; }
  std::vector<std::int16_t>& weights() { return weights_; }
  std::array<std::uint16_t, kDecisionCount>& rare() { return rare_; }

  static constexpr std::uint32_t kCountMax = 1000;

 private:
  using Lanes __attribute__((vector_size(16))) = std::int16_t;  // Eight inputs or weights at once.
  using Inputs = std::array<Lanes, kInputs / 8>;

  static constexpr int kWeightBits = 14;
  static constexpr int kErrorShift = 2;       // Scales an error to fit into 16 bits.
  static constexpr int kBiasLogit = 256;      // Value of the constant bias input.
  static constexpr int kRefinementShift = 6;  // Adaptation rate of the refinement table: 1/64.
  static constexpr int kFinalMin = 24;        // Lowest probability: no bit costs more than 12 bits.
  static constexpr std::uint32_t kRefinementKnots = 33;
  static constexpr std::uint32_t kRefinementStep = 128;  // Distance of neighbouring table entries, in logit units.
  static constexpr int kRefinementMax = kRefinementStep * (kRefinementKnots - 1) / 2;

  // The adaptation rate by count: 1 / (count + 1.6) in units of 1/2^16. The last two bits are zeros.
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

  // The weighted sums of the two mixes (Sums) and their errors (Errors).
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

  std::vector<Slot> slots_;  // Indexed by decision, model and context.
  // Indexed by has_previous, decision, mix, set of weights, and input.
  std::vector<std::int16_t> weights_;
  std::vector<std::uint16_t> refinements_;
  std::array<std::uint16_t, kDecisionCount> rare_;
  std::uint32_t count_limit_;
};

// A probability, and pointers to the table entries from which it was computed.
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
  // Write whole vectors. Reading a vector just after writing its numbers one by one stalls the processor.
  made.inputs[0] = Lanes{input(0), input(1), input(2), input(3), input(4), input(5), input(6), input(7)};
  made.inputs[1] = Lanes{input(8), input(9), input(10), input(11), input(12), input(13), input(14), input(15)};
  std::int16_t* const sets = weights_.data() + table * kSetsPerDecision * kInputs;
  made.weights[0] = sets + contexts.weight_sets[0] * kInputs;
  made.weights[1] = sets + (kWeightSetCounts[0] + contexts.weight_sets[1]) * kInputs;
  const Sums sums = Multiply(made.inputs, made.weights[0], made.weights[1]);
  made.mixed[0] = std::clamp(sums.first >> kWeightBits, -kSquashMax, kSquashMax);
  made.mixed[1] = std::clamp(sums.second >> kWeightBits, -kSquashMax, kSquashMax);
  const int logit = (made.mixed[0] + made.mixed[1]) >> 1;
  // Interpolate linearly between the two nearest knots of the refinement table.
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
