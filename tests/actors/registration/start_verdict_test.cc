#include "actors/registration/start_verdict.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

// Figures of a set, as JudgeStart takes them.
struct Figures {
  double evidence = 15;
  double matched = 0.95;
  double contradicted = 0.02;
  double sigma_m = 0.15;
  double span_m = 8;
};

StartVerdict VerdictOn(const std::vector<Figures>& sets) {
  std::vector<JudgedSet> judged;
  for (const Figures& figures : sets) {
    judged.push_back({figures.evidence, figures.matched, figures.contradicted, figures.sigma_m, figures.span_m});
  }
  return JudgeSets(judged).verdict;
}

TEST(StartVerdictTest, AcceptsASetThatMatchesEverywhereWithoutARival) {
  EXPECT_EQ(VerdictOn({{}}), StartVerdict::kAccepted);
  EXPECT_EQ(VerdictOn({{}, {.evidence = 9.9}}), StartVerdict::kAccepted);
}

TEST(StartVerdictTest, NamesTheConditionThatFails) {
  EXPECT_EQ(VerdictOn({}), StartVerdict::kNoPlace);
  EXPECT_EQ(VerdictOn({{.span_m = 3.9}}), StartVerdict::kFewSubmaps);
  EXPECT_EQ(VerdictOn({{.sigma_m = 0.26}}), StartVerdict::kUncertain);
  EXPECT_EQ(VerdictOn({{.evidence = 11.9}}), StartVerdict::kLittleEvidence);
  EXPECT_EQ(VerdictOn({{}, {.evidence = 10.1}}), StartVerdict::kRival);
  EXPECT_EQ(VerdictOn({{.matched = 0.89}}), StartVerdict::kContradicted);
  EXPECT_EQ(VerdictOn({{.contradicted = 0.07}}), StartVerdict::kContradicted);
}

TEST(StartVerdictTest, ARivalThatContradictsMuchNeedsOnlyLessEvidence) {
  EXPECT_EQ(VerdictOn({{}, {.evidence = 14.9, .contradicted = 0.15}}), StartVerdict::kAccepted);
  EXPECT_EQ(VerdictOn({{}, {.evidence = 15.1, .contradicted = 0.15}}), StartVerdict::kRival);
}

TEST(StartVerdictTest, MuchEvidenceAllowsMoreContradictionsIfNoRivalHasAThird) {
  const Figures strong = {.evidence = 40, .matched = 0.86, .contradicted = 0.09};
  EXPECT_EQ(VerdictOn({strong}), StartVerdict::kAccepted);
  EXPECT_EQ(VerdictOn({strong, {.evidence = 13, .contradicted = 0.1}}), StartVerdict::kAccepted);
  EXPECT_EQ(VerdictOn({strong, {.evidence = 14, .contradicted = 0.5}}), StartVerdict::kContradicted);
  EXPECT_EQ(VerdictOn({{.evidence = 39, .matched = 0.86, .contradicted = 0.09}}), StartVerdict::kContradicted);
  EXPECT_EQ(VerdictOn({{.evidence = 40, .matched = 0.84, .contradicted = 0.09}}), StartVerdict::kContradicted);
}

TEST(StartVerdictTest, TwoSetsThatWouldBeAcceptedAloneExcludeEachOther) {
  EXPECT_EQ(VerdictOn({{.evidence = 60}, {.evidence = 12}}), StartVerdict::kRival);
  EXPECT_EQ(VerdictOn({{.evidence = 60}, {.evidence = 12, .matched = 0.89}}), StartVerdict::kAccepted);
}

TEST(StartVerdictTest, HasAText) {
  for (int i = 0; i <= static_cast<int>(StartVerdict::kFewMaps); ++i) {
    EXPECT_NE(ToString(static_cast<StartVerdict>(i)), "unknown") << i;
  }
}

}  // namespace
}  // namespace moondb
