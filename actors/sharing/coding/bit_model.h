// BitModel: foretells one bit at a time by mixing what several contexts have seen (logistic mixing, as in PAQ).
//
// Each context model holds a probability for each of its contexts, with a count of what it has seen: the more, the
// slower it adapts. Their logits are mixed by two sets of weights, each chosen by a context of its own; the mean of the
// two is refined by a last table; and everything learns from the bit. Whole numbers only.
//
// There are two decisions a cell, with tables of their own, and each is made with or without a previous map, with
// weights of their own. A run's model begins as a copy of LearntModel() (learnt_tables.h): what it holds is part of the
// wire format, and so is every number here. 1 MB. Not thread-safe.
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
  // A context model's memory of one context.
  struct Slot {
    std::uint16_t p = kProbabilityOne / 2;
    std::uint16_t count = 0;
  };

  // Knows nothing.
  BitModel();

  // The probability that the next bit is 1.
  int Predict(const BitContexts& contexts);
  // What it was. Follows each Predict.
  void Update(int bit);

  // For bits that are nearly certain: one adaptive probability for all of them, without mixing.
  int PredictRare(Decision decision) const { return rare_[static_cast<std::size_t>(decision)]; }
  void UpdateRare(Decision decision, int bit);

  // Contexts that have seen so much adapt no slower; at most kCountMax. Learning takes more than coding.
  void SetCountLimit(int limit) { count_limit_ = limit; }

  // What learnt tables hold: all slots, all weights in 1/16384, the probabilities of rare bits.
  std::vector<Slot>& slots() { return slots_; }
  std::vector<std::int16_t>& weights() { return weights_; }
  std::array<std::uint16_t, kDecisionCount>& rare() { return rare_; }

  static constexpr int kCountMax = 1000;

 private:
  // Offsets into the three tables, and what was made of them.
  struct Prediction {
    std::array<std::uint32_t, kModelsWithPrevious> slots{};
    std::array<std::int16_t, kInputs> inputs{};
    std::array<std::uint32_t, kChoiceCount> weights{};
    std::array<std::int32_t, kChoiceCount> mixed{};
    std::uint32_t refinement = 0;
    bool has_previous = false;
  };

  template <std::size_t kModels>
  int Mix(const BitContexts& contexts);
  template <std::size_t kModels>
  void Learn(int bit);

  std::vector<Slot> slots_;            // [decision][model][context]
  std::vector<std::int16_t> weights_;  // Alone, then with a previous map: [decision][choice][set][input]
  std::vector<std::uint16_t> refinements_;
  std::array<std::uint16_t, kDecisionCount> rare_;
  int count_limit_;
  Prediction last_;
};

}  // namespace moondb
