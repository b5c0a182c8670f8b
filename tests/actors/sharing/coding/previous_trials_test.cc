#include "actors/sharing/coding/previous_trials.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

using Way = PreviousTrials::Way;

// Reports maps coded in `way` to `trials` until `trials` chooses another way. Returns the number of these maps, at most
// 1,000.
int CountOf(Way way, PreviousTrials& trials) {
  int count = 0;
  for (; trials.next() == way && count < 1000; ++count) trials.Coded(way, /*is_placed=*/true);
  return count;
}

TEST(PreviousTrialsTest, StartsWithATrial) { EXPECT_EQ(PreviousTrials().next(), Way::kBoth); }

TEST(PreviousTrialsTest, PausesAfterTwoTrialsWithLittleGain) {
  PreviousTrials trials;
  trials.Compared(100, 90);
  EXPECT_EQ(trials.next(), Way::kBoth);
  trials.Compared(100, 90);
  EXPECT_EQ(CountOf(Way::kAlone, trials), PreviousTrials::kRestMaps);
  EXPECT_EQ(trials.next(), Way::kBoth);
  trials.Compared(100, 90);
  EXPECT_EQ(CountOf(Way::kAlone, trials), PreviousTrials::kRestMaps);
}

TEST(PreviousTrialsTest, SkipsComparingAfterALargeGain) {
  PreviousTrials trials;
  trials.Compared(100, 50);
  EXPECT_EQ(CountOf(Way::kWithPrevious, trials), PreviousTrials::kTrustMaps);
  EXPECT_EQ(trials.next(), Way::kBoth);
}

TEST(PreviousTrialsTest, KeepsComparingAfterAModerateGain) {
  PreviousTrials trials;
  for (int i = 0; i < 10; ++i) trials.Compared(100, 80);
  EXPECT_EQ(trials.next(), Way::kBoth);
}

TEST(PreviousTrialsTest, CountsAMapThatCannotBePlacedAsAFailure) {
  PreviousTrials trials;
  trials.Compared(100, 50);
  trials.Coded(Way::kWithPrevious, /*is_placed=*/false);
  EXPECT_EQ(trials.next(), Way::kBoth);
  trials.Coded(Way::kBoth, /*is_placed=*/false);
  EXPECT_EQ(trials.next(), Way::kAlone);
}

TEST(PreviousTrialsTest, ForgetsFailuresAfterASuccess) {
  PreviousTrials trials;
  for (int i = 0; i < 5; ++i) {
    trials.Compared(100, 95);
    trials.Compared(100, 80);
  }
  EXPECT_EQ(trials.next(), Way::kBoth);
}

}  // namespace
}  // namespace moondb
