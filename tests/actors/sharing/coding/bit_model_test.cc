#include "actors/sharing/coding/bit_model.h"

#include <gtest/gtest.h>

#include <random>

#include "actors/sharing/coding/trained_tables.h"

namespace moondb {
namespace {

// Returns contexts in which the first model has the context `first`. All other models always have the same context.
BitContexts ContextsOf(std::uint32_t first, bool has_previous = false) {
  BitContexts contexts;
  contexts.has_previous = has_previous;
  contexts.models[0] = first;
  return contexts;
}

void Show(const BitContexts& contexts, int bit, int times, BitModel& model) {
  for (int i = 0; i < times; ++i) {
    model.Update(model.Predict(contexts), bit);
  }
}

TEST(BitModelTest, PredictsNearlyEvenOddsAtFirst) {
  BitModel model;
  EXPECT_NEAR(model.Predict(ContextsOf(0)).probability, kProbabilityOne / 2, kProbabilityOne / 5);
}

TEST(BitModelTest, LearnsTheBitsThatItSees) {
  for (const bool has_previous : {false, true}) {
    for (const int bit : {0, 1}) {
      BitModel model;
      Show(ContextsOf(7, has_previous), bit, 300, model);
      const int p = model.Predict(ContextsOf(7, has_previous)).probability;
      EXPECT_LT(bit == 1 ? kProbabilityOne - p : p, kProbabilityOne / 50);
    }
  }
}

TEST(BitModelTest, TrustsTheModelThatPredictsWell) {
  BitModel model;
  std::mt19937 rng(61);
  for (int i = 0; i < 4000; ++i) {
    const std::uint32_t first = rng() % 2;
    // Only the first model's context predicts the bit. To all other models the bits are random.
    Show(ContextsOf(first), static_cast<int>(first), 1, model);
  }
  EXPECT_GT(model.Predict(ContextsOf(1)).probability, kProbabilityOne * 19 / 20);
  EXPECT_LT(model.Predict(ContextsOf(0)).probability, kProbabilityOne / 20);
}

TEST(BitModelTest, NeverPredictsABitWithCertainty) {
  BitModel model;
  Show(ContextsOf(0), 1, 100'000, model);
  EXPECT_LT(model.Predict(ContextsOf(0)).probability, kProbabilityOne);
  for (int i = 0; i < 100'000; ++i) model.UpdateRare(Decision::kIsKnown, 0);
  EXPECT_GT(model.PredictRare(Decision::kIsKnown), 0);
}

TEST(BitModelTest, RestoresNearlyTheSameModelFromItsText) {
  BitModel model;
  std::mt19937 rng(62);
  for (int i = 0; i < 5000; ++i) Show(ContextsOf(rng() % 50, i % 3 == 0), rng() % 4 == 0 ? 1 : 0, 1, model);
  BitModel read = ReadTables(WriteTables(model));
  EXPECT_EQ(WriteTables(read), WriteTables(model));
  for (std::uint32_t first = 0; first < 50; ++first) {
    const BitContexts contexts = ContextsOf(first);
    EXPECT_NEAR(Stretch(read.Predict(contexts).probability), Stretch(model.Predict(contexts).probability), 150)
        << first;
  }
}

TEST(BitModelTest, HasAnInitialModel) { EXPECT_FALSE(kTrainedTables.empty()); }

}  // namespace
}  // namespace moondb
