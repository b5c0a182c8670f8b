#include "actors/registration/match_candidates.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

RegisteredMap MapAt(AgentId agent, std::uint64_t index, double x_m, double y_m = 0) {
  RegisteredMap map;
  map.node = {agent, index};
  map.map_from_local = Pose::FromPlanar(x_m, y_m, 0);
  return map;
}

TEST(MatchCandidatesTest, AreTheThreeNearestMapsOfEachAgentWithin6Metres) {
  std::vector<RegisteredMap> maps = {MapAt(1, 0, 0)};
  for (std::uint64_t i = 0; i < 5; ++i) maps.push_back(MapAt(2, i, 1 + static_cast<double>(i)));
  maps.push_back(MapAt(3, 0, -5.9));
  maps.push_back(MapAt(4, 0, 0, 6.1));
  const std::vector<MatchCandidate> found = FindCandidates(maps, 0);
  std::vector<std::size_t> others;
  for (const MatchCandidate& candidate : found) {
    EXPECT_EQ(candidate.first, 0u);
    others.push_back(candidate.second);
  }
  EXPECT_EQ(others, (std::vector<std::size_t>{1, 2, 3, 6}));
  EXPECT_NEAR(found.back().distance_m, 5.9, 1e-9);
}

TEST(MatchCandidatesTest, OfOneAgentAreAtLeastTenNodesApart) {
  std::vector<RegisteredMap> maps;
  for (std::uint64_t i = 0; i < 12; ++i) maps.push_back(MapAt(1, i, 0));
  EXPECT_EQ(FindCandidates(maps, 11).size(), 2u);  // Nodes 0 and 1.
  EXPECT_TRUE(FindCandidates(maps, 5).empty());
}

TEST(MatchCandidatesTest, AreAtMost16OfOneMap) {
  std::vector<RegisteredMap> maps = {MapAt(1, 0, 0)};
  for (AgentId agent = 2; agent < 12; ++agent) {
    for (std::uint64_t i = 0; i < 3; ++i) maps.push_back(MapAt(agent, i, 1 + 0.01 * agent));
  }
  EXPECT_EQ(FindCandidates(maps, 0).size(), 16u);
}

class MatchToClosureTest : public testing::Test {
 protected:
  // Two nodes with tilted poses, whose maps lie 0.2 m ahead of the nodes, and a match that moves the second map.
  MatchToClosureTest() {
    first_node_.position_m = {1, 2, 0.3};
    first_node_.orientation =
        Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX());
    second_node_.position_m = {3, 1, 0.5};
    second_node_.orientation =
        Eigen::AngleAxisd(-1.2, Eigen::Vector3d::UnitZ()) * Eigen::AngleAxisd(-0.08, Eigen::Vector3d::UnitY());
    first_.node = {1, 4};
    second_.node = {2, 7};
    first_.timestamp_ns = 5;
    second_.timestamp_ns = 9;
    first_.map_from_local = first_node_ * Pose::FromPlanar(0.2, 0, 0);
    second_.map_from_local = second_node_ * Pose::FromPlanar(0.2, 0, 0);
    match_.covariance.diagonal() << 0.01, 0.0025, 1e-4;
  }

  LoopClosure Closure() const { return ToLoopClosure(first_, first_node_, second_, second_node_, match_); }
  PlanarOffset Expected() const {
    return PlanarOffset::From(PlanarOffset::From(first_.map_from_local).ToPose().Inverse() *
                              PlanarOffset::From(second_.map_from_local).ToPose());
  }

  Pose first_node_;
  Pose second_node_;
  RegisteredMap first_;
  RegisteredMap second_;
  MatchResult match_;
};

TEST_F(MatchToClosureTest, AMatchAtTheExpectedOffsetChangesNothing) {
  match_.first_from_second = Expected();
  const LoopClosure closure = Closure();
  EXPECT_EQ(closure.from, first_.node);
  EXPECT_EQ(closure.to, second_.node);
  EXPECT_EQ(closure.timestamp_ns, 9);
  EXPECT_EQ(closure.source, "registration");
  const Pose error = closure.from_from_to.Inverse() * (first_node_.Inverse() * second_node_);
  EXPECT_LT(error.position_m.norm(), 1e-9);
  EXPECT_LT(error.orientation.vec().norm(), 1e-9);
}

TEST_F(MatchToClosureTest, TheClosurePlacesTheSecondMapAtTheMatch) {
  match_.first_from_second = Expected();
  match_.first_from_second.x_m += 0.4;
  match_.first_from_second.y_m -= 0.1;
  match_.first_from_second.yaw_rad += 0.05;
  second_node_ = first_node_ * Closure().from_from_to;
  second_.map_from_local = second_node_ * Pose::FromPlanar(0.2, 0, 0);
  const PlanarOffset placed = Expected();
  EXPECT_NEAR(placed.x_m, match_.first_from_second.x_m, 1e-6);
  EXPECT_NEAR(placed.y_m, match_.first_from_second.y_m, 1e-6);
  EXPECT_NEAR(placed.yaw_rad, match_.first_from_second.yaw_rad, 1e-6);
  EXPECT_NEAR(second_node_.position_m.z(), 0.5, 1e-9);
}

// Draws matches with the stated covariance and compares the scatter of the closures.
TEST_F(MatchToClosureTest, TheCovarianceIsThatOfTheNodesOffset) {
  first_node_.orientation = Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitZ());
  second_node_.orientation = Eigen::AngleAxisd(-1.2, Eigen::Vector3d::UnitZ());
  first_.map_from_local = first_node_ * Pose::FromPlanar(0.2, 0, 0);
  second_.map_from_local = second_node_ * Pose::FromPlanar(2, 0, 0);
  const PlanarOffset expected = Expected();
  match_.first_from_second = expected;
  const LoopClosure mean = Closure();
  Matrix6d scatter = Matrix6d::Zero();
  // Two points per axis, at plus and minus sqrt(3) sigma, have the mean and the covariance of the distribution.
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      Eigen::Vector3d off = Eigen::Vector3d::Zero();
      off[axis] = sign * std::sqrt(3 * match_.covariance(axis, axis));
      match_.first_from_second = {expected.x_m + off.x(), expected.y_m + off.y(), expected.yaw_rad + off.z()};
      const LoopClosure drawn = Closure();
      Eigen::Matrix<double, 6, 1> difference;
      difference.head<3>() = drawn.from_from_to.position_m - mean.from_from_to.position_m;
      difference.tail<3>() = 2 * (mean.from_from_to.orientation.conjugate() * drawn.from_from_to.orientation).vec();
      scatter += difference * difference.transpose() / 6;
    }
  }
  for (const int row : {0, 1, 5}) {
    for (const int column : {0, 1, 5}) {
      EXPECT_NEAR(mean.covariance(row, column), scatter(row, column), 2e-4) << row << ' ' << column;
    }
  }
  EXPECT_NEAR(mean.covariance(2, 2), 1, 1e-9);
}

}  // namespace
}  // namespace moondb
