#include "actors/pgo/outlier_tests.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "actors/pgo/initial_values.h"

namespace moondb {
namespace {

FactorKey Range(std::uint64_t index) { return {FactorKind::kRange, {1, index}, {2, index}, {}}; }

// Two rovers, with one range between them at each timestamp.
class OutlierTestsTest : public testing::Test {
 protected:
  void Use(const std::vector<std::int64_t>& timestamps_s) {
    graph_ = {};
    for (std::size_t i = 0; i < timestamps_s.size(); ++i) {
      for (const AgentId agent : {AgentId{1}, AgentId{2}}) graph_.nodes.push_back(GraphNode{{agent, i}, 0, Pose{}});
      graph_.ranges.push_back(RangeEdge{{1, i}, {2, i}, timestamps_s[i] * 1'000'000'000, 1, 0.01});
    }
    checked_ = CheckGraph(graph_, {});
    rovers_ = FindRovers(checked_);
    starts_.clear();
    for (const Rover& rover : rovers_) starts_.push_back(FindStartPrior(checked_.nodes[rover.first], {}, {}));
    initial_ = FindInitialValues(checked_, rovers_, starts_, {});
  }

  std::vector<bool> Inliers(const std::vector<double>& residuals) {
    const CostTerms terms(checked_, rovers_, starts_, {}, initial_, std::vector<bool>(checked_.nodes.size(), true),
                          options_);
    const std::vector<bool> all(residuals.size(), true);
    return FindInliers(checked_, terms, residuals, all, all, options_);
  }

  FirstVerdicts First(const std::vector<double>& residuals, std::size_t known, const std::set<FactorKey>& rejected) {
    LastSolution last;
    for (const CheckedNode& node : checked_.nodes) {
      if (node.key.index < known) last.poses[node.key] = node.raw;
    }
    last.rejected = rejected;
    initial_ = FindInitialValues(checked_, rovers_, starts_, last.poses);
    return FindFirstVerdicts(checked_, initial_, residuals, last, options_);
  }

  SolverOptions options_;
  PoseGraph graph_;
  CheckedGraph checked_;
  std::vector<Rover> rovers_;
  std::vector<StartPrior> starts_;
  InitialValues initial_;
};

TEST_F(OutlierTestsTest, DoubtsNeighboursOfARejectedRangeWithAnErrorOfTheSameSign) {
  Use({0, 30, 60, 90});
  EXPECT_THAT(Inliers({-5, -3, -2, -3}), testing::ElementsAre(false, false, true, true));
  EXPECT_THAT(Inliers({-5, 3, -3, 0}), testing::ElementsAre(false, true, true, true));
}

TEST_F(OutlierTestsTest, EndsABurstAtAPauseOfTheRanges) {
  Use({0, 30, 60, 1000, 1030});
  EXPECT_THAT(Inliers({0, 0, -5, -3, 0}), testing::ElementsAre(true, true, false, true, true));
}

TEST_F(OutlierTestsTest, KeepsTheLastVerdictsAndJudgesNewRangesByTheirFirstGuess) {
  Use({0, 30, 60, 90, 120});
  const FirstVerdicts first = First({0, 20, 0, 3, 0}, 3, {Range(0)});
  EXPECT_THAT(first.is_inlier, testing::ElementsAre(false, true, true, true, true));
  EXPECT_THAT(first.is_trusted, testing::ElementsAre(false, true, true, false, false));
  EXPECT_FALSE(first.is_doubtful);
}

TEST_F(OutlierTestsTest, DoubtsItsFirstGuessIfManyNewRangesDoNotFit) {
  Use({0, 30, 60, 90, 120});
  const FirstVerdicts first = First({0, 0, 0, 20, 0}, 3, {});
  EXPECT_THAT(first.is_inlier, testing::ElementsAre(true, true, true, false, true));
  EXPECT_THAT(first.is_inlier_before, testing::Each(true));
  EXPECT_TRUE(first.is_doubtful);
}

TEST_F(OutlierTestsTest, DoubtsTheLastVerdictsIfMostRangesOfARoverWereRejected) {
  Use({0, 30, 60, 90, 120});
  EXPECT_TRUE(First({0, 0, 0, 0, 0}, 5, {Range(0), Range(1), Range(2)}).is_doubtful);
  EXPECT_FALSE(First({0, 0, 0, 0, 0}, 5, {Range(0), Range(1)}).is_doubtful);
}

}  // namespace
}  // namespace moondb
