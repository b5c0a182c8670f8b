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

std::vector<std::pair<std::size_t, std::size_t>> PairsOf(const std::vector<RegisteredMap>& maps,
                                                         bool are_joined = true) {
  std::vector<std::pair<std::size_t, std::size_t>> pairs;
  for (const MatchCandidate& candidate :
       FindCandidates(maps, {}, [&](AgentId a, AgentId b) { return a == b || are_joined; })) {
    pairs.emplace_back(candidate.first, candidate.second);
  }
  return pairs;
}

TEST(MatchCandidatesTest, AreTheThreeNearestMapsOfEachAgentWithin6MetresNearestFirst) {
  std::vector<RegisteredMap> maps = {MapAt(1, 0, 0)};
  for (std::uint64_t i = 0; i < 5; ++i) maps.push_back(MapAt(2, i, 8 - static_cast<double>(i)));  // 8 to 4 m.
  maps.push_back(MapAt(3, 0, -5.9));
  maps.push_back(MapAt(4, 0, 0, -6.1));
  std::vector<std::pair<std::size_t, std::size_t>> of_first;
  for (const auto& pair : PairsOf(maps)) {
    if (pair.first == 0) of_first.push_back(pair);
  }
  EXPECT_EQ(of_first, (std::vector<std::pair<std::size_t, std::size_t>>{{0, 5}, {0, 4}, {0, 6}, {0, 3}}));
}

TEST(MatchCandidatesTest, OfOneAgentAreAtLeastTenNodesApart) {
  std::vector<RegisteredMap> maps;
  for (std::uint64_t i = 0; i < 12; ++i) maps.push_back(MapAt(1, i, static_cast<double>(i) * 0.5));
  EXPECT_EQ(PairsOf(maps), (std::vector<std::pair<std::size_t, std::size_t>>{{0, 10}, {1, 11}, {0, 11}}));
}

TEST(MatchCandidatesTest, AreAtMost16OfOneMap) {
  std::vector<RegisteredMap> maps = {MapAt(1, 0, 0)};
  // Each agent's maps have nearer partners than map 0.
  for (AgentId agent = 2; agent < 12; ++agent) {
    for (std::uint64_t i = 0; i < 3; ++i) maps.push_back(MapAt(agent, i, 3 + 0.01 * agent));
  }
  for (AgentId agent = 20; agent < 40; ++agent) maps.push_back(MapAt(agent, 0, 3, 0.1));
  std::size_t count = 0;
  for (const auto& pair : PairsOf(maps)) count += pair.first == 0 ? 1 : 0;
  EXPECT_EQ(count, 16u);
}

TEST(MatchCandidatesTest, LeaveOutAgentsWhoseRelativePoseIsUnknown) {
  std::vector<RegisteredMap> maps = {MapAt(1, 0, 0), MapAt(2, 0, 1), MapAt(1, 10, 1)};
  EXPECT_EQ(PairsOf(maps).size(), 3u);
  EXPECT_EQ(PairsOf(maps, false), (std::vector<std::pair<std::size_t, std::size_t>>{{0, 2}}));
}

TEST(MatchCandidatesTest, OfARobotThatStandsStillUseItsLastMap) {
  std::vector<RegisteredMap> maps = {MapAt(2, 0, 1)};
  for (std::uint64_t i = 0; i < 5000; ++i) maps.push_back(MapAt(1, i, 0));
  EXPECT_EQ(PairsOf(maps), (std::vector<std::pair<std::size_t, std::size_t>>{{0, 5000}}));
}

TEST(MatchCandidatesTest, OfASquareThatARobotCrossesOftenUseTheLastEightMaps) {
  std::vector<RegisteredMap> maps = {MapAt(2, 0, 1)};
  for (std::uint64_t i = 0; i < 5000; ++i) maps.push_back(MapAt(1, i, i % 2 == 0 ? 0.25 : 20));
  for (const auto& [first, second] : PairsOf(maps)) EXPECT_GT(second, 4984u);
  EXPECT_FALSE(PairsOf(maps).empty());
}

TEST(MatchCandidatesTest, ADenseDriveHasOneMapForEachStretchOrTurn) {
  std::vector<RegisteredMap> dense = {MapAt(2, 0, 0)};
  for (std::uint64_t i = 0; i < 50; ++i) dense.push_back(MapAt(1, i, 0.1 * static_cast<double>(i)));
  CandidateOptions options;
  options.apart_m = 0.45;
  options.apart_rad = 0.52;
  options.of_agent_max = 100;
  options.of_map_max = 100;
  const auto all = [](AgentId a, AgentId b) { return a != b; };
  EXPECT_EQ(FindCandidates(dense, options, all).size(), 10u);
  std::vector<RegisteredMap> sparse = {MapAt(2, 0, 0)};
  for (std::uint64_t i = 0; i < 10; ++i) sparse.push_back(MapAt(1, i, 0.5 * static_cast<double>(i)));
  EXPECT_EQ(FindCandidates(sparse, options, all).size(), 10u);
  std::vector<RegisteredMap> turning = {MapAt(2, 0, 0)};
  for (std::uint64_t i = 0; i < 20; ++i) {
    turning.push_back(MapAt(1, i, 0));
    turning.back().map_from_local = Pose::FromPlanar(0, 0, 0.1 * static_cast<double>(i));
  }
  options.of_square_max = 100;
  EXPECT_EQ(FindCandidates(turning, options, all).size(), 4u);
}

TEST(MatchCandidatesTest, FurtherMapsOfADenseDriveLeaveTheOldPairsAsTheyAre) {
  std::vector<RegisteredMap> maps = {MapAt(2, 0, 0)};
  std::vector<std::pair<std::size_t, std::size_t>> last;
  for (std::uint64_t i = 0; i < 60; ++i) {
    maps.push_back(MapAt(1, i, 0.1 * static_cast<double>(i)));
    auto pairs = PairsOf(maps);
    std::ranges::sort(pairs);
    std::size_t kept = 0;
    for (const auto& pair : last) kept += std::ranges::count(pairs, pair);
    EXPECT_GE(kept + 6, last.size()) << "more than the pairs of one map changed at map " << i;
    last = std::move(pairs);
  }
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
    Place(0.2);
    match_.covariance.diagonal() << 0.01, 0.0025, 1e-4;
  }

  // Places both maps at their nodes; the second one lies `ahead_m` ahead of its node.
  void Place(double ahead_m) {
    first_.map_from_node = first_node_;
    second_.map_from_node = second_node_;
    first_.map_from_local = first_node_ * Pose::FromPlanar(0.2, 0, 0);
    second_.map_from_local = second_node_ * Pose::FromPlanar(ahead_m, 0, 0);
  }

  LoopClosure Closure() const { return ToLoopClosure(first_, second_, match_); }
  PlanarOffset Expected() const { return PlanarOffset::Between(first_.map_from_local, second_.map_from_local); }

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
  Place(0.2);
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
  Place(2);
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
  scatter(5, 5) *= 9;
  for (const int row : {0, 1, 5}) {
    for (const int column : {0, 1, 5}) {
      EXPECT_NEAR(mean.covariance(row, column), scatter(row, column), 2e-4) << row << ' ' << column;
    }
  }
  EXPECT_NEAR(mean.covariance(2, 2), 1, 1e-9);
}

}  // namespace
}  // namespace moondb
