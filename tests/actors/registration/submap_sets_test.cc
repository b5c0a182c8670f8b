#include "actors/registration/submap_sets.h"

#include <gtest/gtest.h>

#include <numbers>

namespace moondb {
namespace {

// Two rovers whose submaps lie 7.5 m apart. The second rover's frame lies at `frame_` in that of the first.
class SubmapSetsTest : public testing::Test {
 protected:
  SubmapSetsTest() : first_(Straight(1)), second_(Straight(2)) {}

  static TrackSubmaps Straight(AgentId agent) {
    std::vector<RoverTrack::Step> steps;
    TrackSubmaps submaps;
    for (std::size_t i = 0; i < 6; ++i) {
      const Eigen::Matrix3d covariance = Eigen::Vector3d(1e-3, 1e-3, 1e-4).asDiagonal();
      steps.push_back({{agent, i}, {7.5 * static_cast<double>(i), 0, 0}, covariance});
      SubmapWindow window;
      window.middle = i;
      submaps.windows.push_back(window);
    }
    submaps.track = std::make_shared<const RoverTrack>(steps);
    return submaps;
  }

  // A place of a submap of the second rover as if its frame was at `frame`.
  SubmapHypothesis PlaceAt(const PlanarOffset& frame, std::size_t first, std::size_t second, double evidence) const {
    SubmapHypothesis one{first, second, {}};
    one.place.first_from_second = first_.OdomFromSubmap(first).Inverse() * frame * second_.OdomFromSubmap(second);
    one.place.covariance = Eigen::Vector3d(0.0225, 0.0225, 0.000225).asDiagonal();
    one.place.evidence = evidence;
    return one;
  }

  SubmapSets Find(std::vector<SubmapHypothesis> hypotheses) const {
    SubmapSets sets(first_, second_, std::move(hypotheses));
    while (sets.FindNext()) continue;
    return sets;
  }

  const TrackSubmaps first_;
  const TrackSubmaps second_;
  const PlanarOffset frame_ = {5, 3, 2.5};
  const PlanarOffset other_ = {25, -8, 0.4};
};

TEST_F(SubmapSetsTest, JoinPlacesThatAgreeAndKeepTheOthersApart) {
  std::vector<SubmapHypothesis> hypotheses;
  for (std::size_t i = 0; i < 4; ++i) hypotheses.push_back(PlaceAt(frame_, i, 3 - i, 2));
  for (std::size_t i = 0; i < 2; ++i) hypotheses.push_back(PlaceAt(other_, i, i, 3));
  const SubmapSets sets = Find(hypotheses);
  ASSERT_EQ(sets.sets().size(), 2u);
  const SubmapSet& best = sets.sets()[0];
  EXPECT_EQ(best.members.size(), 4u);
  EXPECT_NEAR(best.evidence, 8, 1e-9);
  EXPECT_NEAR(sets.sets()[1].evidence, 6, 1e-9);
  for (std::size_t i = 0; i < second_.windows.size(); ++i) {
    const PlanarOffset truth = frame_ * second_.OdomFromSubmap(i);
    EXPECT_LT((best.SecondPose(i).position_m() - truth.position_m()).norm(), 1e-3) << i;
  }
  EXPECT_LT(best.sigma_m, 0.25);
}

TEST_F(SubmapSetsTest, CountTheBestPlaceOfEachSubmapForTheWeakerRover) {
  // All places are those of one submap of the second rover.
  std::vector<SubmapHypothesis> hypotheses = {PlaceAt(frame_, 0, 2, 5), PlaceAt(frame_, 1, 2, 4),
                                              PlaceAt(frame_, 2, 2, 3)};
  EXPECT_NEAR(Find(hypotheses).sets()[0].evidence, 5, 1e-9);
  hypotheses.push_back(PlaceAt(frame_, 3, 3, 1));
  EXPECT_NEAR(Find(hypotheses).sets()[0].evidence, 6, 1e-9);
}

TEST_F(SubmapSetsTest, LeaveOutPlacesBeyondTheErrorOfOdometry) {
  PlanarOffset off = frame_;
  off.x_m += 0.1;
  PlanarOffset far = frame_;
  far.x_m += 3;
  const SubmapSets sets =
      Find({PlaceAt(frame_, 0, 0, 5), PlaceAt(frame_, 1, 1, 5), PlaceAt(off, 2, 2, 4), PlaceAt(far, 1, 2, 4)});
  EXPECT_EQ(sets.sets()[0].members, (std::vector<std::size_t>{0, 1, 2}));
}

TEST_F(SubmapSetsTest, AreEmptyWithoutPlacesAndBounded) {
  EXPECT_TRUE(Find({}).sets().empty());
  std::vector<SubmapHypothesis> many;
  for (int i = 0; i < 1000; ++i) {
    many.push_back(
        PlaceAt({0.1 * i, 0.2 * i, 0.3 * i}, static_cast<std::size_t>(i % 6), static_cast<std::size_t>(i % 5), 1));
  }
  const SubmapSets sets(first_, second_, many);
  EXPECT_EQ(sets.hypotheses().size(), SubmapSets::kHypothesesMax);
}

}  // namespace
}  // namespace moondb
