#include "model/far_nodes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

using Positions = std::vector<std::pair<NodeKey, Eigen::Vector3d>>;

Positions Drives(AgentId agent, std::uint64_t count, double step_m, const Eigen::Vector3d& from) {
  Positions positions;
  for (std::uint64_t i = 0; i < count; ++i) {
    positions.push_back({{agent, i}, from + Eigen::Vector3d(step_m * static_cast<double>(i), 0, 0)});
  }
  return positions;
}

Positions Join(Positions a, const Positions& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

TEST(FarNodesTest, NamesASingleWrongPose) {
  Positions positions = Join(Drives(1, 100, 1, {0, 0, 0}), Drives(3, 600, 1, {0, 50, 0}));
  EXPECT_TRUE(FindFarNodes(positions).empty());
  positions[600].second.x() += 30'000;  // Node 500 of agent 3.
  positions[10].second.y() -= 12'000;
  const std::vector<FarNode> far = FindFarNodes(positions);
  ASSERT_EQ(far.size(), 2u);
  EXPECT_EQ(far[0].node, (NodeKey{3, 500}));
  EXPECT_NEAR(far[0].distance_m, 30'000, 700);
  EXPECT_EQ(far[1].node, (NodeKey{1, 10}));
}

// One agent may insert more nodes than all others, at one place far away.
TEST(FarNodesTest, ManyNodesOfOneAgentDoNotMakeOthersFar) {
  const Positions honest = Join(Drives(1, 20, 1, {0, 0, 0}), Drives(2, 20, 1, {0, 50, 0}));
  EXPECT_TRUE(FindFarNodes(Join(honest, Drives(3, 17'000, 0, {20'000, 0, 0}))).empty());
  EXPECT_EQ(FindFarNodes(Join(honest, Drives(3, 30, 0, {20'000, 0, 0}))).size(), 30u);
}

TEST(FarNodesTest, AllowsTeamsThatAreFarApartOrDriveFar) {
  EXPECT_TRUE(FindFarNodes(Join(Drives(1, 5, 1, {0, 0, 0}), Drives(2, 5, 1, {9'000, 0, 0}))).empty());
  EXPECT_TRUE(FindFarNodes(Join(Drives(1, 2000, 2, {0, 0, 0}), Drives(2, 5, 1, {35'000, 0, 0}))).empty());
  EXPECT_EQ(FindFarNodes(Join(Drives(1, 2000, 2, {0, 0, 0}), Drives(2, 5, 1, {55'000, 0, 0}))).size(), 5u);
  EXPECT_TRUE(FindFarNodes({}).empty());
  EXPECT_TRUE(FindFarNodes(Join(Drives(1, 5, 1, {0, 0, 0}), Drives(2, 5, 1, {1e6, 0, 0}))).empty())
      << "which is right?";
}

}  // namespace
}  // namespace moondb
