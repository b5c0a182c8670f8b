#include "actors/pgo/graph_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace moondb {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

class GraphCheckTest : public testing::Test {
 protected:
  void SetUp() override {
    for (const NodeKey& key : {NodeKey{2, 0}, NodeKey{1, 1}, NodeKey{1, 0}, NodeKey{1, 2}}) {
      graph_.nodes.push_back(GraphNode{key, 0, Pose{}});
    }
    agents_[4] = AgentFacts{4, true, Pose::FromPlanar(1, 2, 0), 0, 0, {0, 0, 1.5}};
  }

  OdometryEdge Step(std::uint64_t from, std::uint64_t to) {
    return OdometryEdge{{1, from}, {1, to}, 0, {}, Matrix6d::Identity()};
  }

  CheckedGraph Checked() { return CheckGraph(graph_, agents_); }

  PoseGraph graph_;
  AgentFactsMap agents_;
};

TEST_F(GraphCheckTest, SortsNodesAndAddsTheBaseStation) {
  const CheckedGraph checked = Checked();
  ASSERT_EQ(checked.nodes.size(), 5u);
  EXPECT_EQ(checked.nodes[0].key, (NodeKey{1, 0}));
  EXPECT_EQ(checked.nodes[3].key, (NodeKey{2, 0}));
  EXPECT_EQ(checked.nodes[4].key, (NodeKey{4, 0}));
  EXPECT_TRUE(checked.nodes[4].is_fixed);
  EXPECT_EQ(checked.nodes[4].raw.position_m, Eigen::Vector3d(1, 2, 0));
  EXPECT_TRUE(checked.left_out.empty());
}

TEST_F(GraphCheckTest, LeavesOutDamagedRecordsAndReportsWhy) {
  graph_.nodes.push_back(GraphNode{{3, 0}, 0, Pose{{kNaN, 0, 0}, Eigen::Quaterniond::Identity()}});
  graph_.odometry = {Step(0, 1), Step(1, 7), Step(1, 1), Step(1, 2), Step(1, 2), Step(0, 1)};
  graph_.odometry[3].covariance(0, 0) = -1;
  graph_.odometry[4].covariance(0, 1) = 0.5;  // This covariance is not symmetric.
  graph_.odometry[5].from_from_to.position_m.x() = kNaN;
  graph_.ranges = {{{1, 0}, {2, 0}, 0, 3, 0.01}, {{1, 0}, {2, 0}, 0, kNaN, 0.01}, {{1, 0}, {2, 0}, 0, 3, 0},
                   {{1, 0}, {1, 1}, 0, 3, 0.01}, {{1, 0}, {9, 0}, 0, 3, 0.01},    {{1, 0}, {3, 0}, 0, 3, 0.01}};
  const CheckedGraph checked = Checked();
  EXPECT_EQ(checked.odometry.size(), 1u);
  EXPECT_EQ(checked.ranges.size(), 1u);
  ASSERT_EQ(checked.left_out.size(), 2u);
  EXPECT_EQ(checked.left_out.at(1).count, 10u);
  EXPECT_EQ(checked.left_out.at(1).first,
            "odometry from agent 1, node 1 to agent 1, node 7: agent 1, node 7 has no node record");
  EXPECT_EQ(checked.left_out.at(3).first, "agent 3, node 0: its pose is not finite or not a rotation");
}

TEST_F(GraphCheckTest, KeepsTheSameDuplicateInAnyOrderOfArrival) {
  for (const bool is_first : {false, true}) {
    graph_.nodes.resize(4);
    const GraphNode other{{1, 1}, 0, Pose::FromPlanar(is_first ? 7 : 8, 0, 0)};
    const GraphNode another{{1, 1}, 0, Pose::FromPlanar(is_first ? 8 : 7, 0, 0)};
    graph_.nodes[1] = other;
    graph_.nodes.push_back(another);
    graph_.ranges = {{{1, 0}, {2, 0}, 0, is_first ? 3.0 : 4.0, 0.01}, {{1, 0}, {2, 0}, 0, is_first ? 4.0 : 3.0, 0.01}};
    const CheckedGraph checked = Checked();
    ASSERT_EQ(checked.nodes.size(), 5u);
    EXPECT_EQ(checked.nodes[1].raw.position_m.x(), 7);
    ASSERT_EQ(checked.ranges.size(), 1u);
    EXPECT_EQ(checked.ranges[0].edge->range_m, 3);
    EXPECT_EQ(checked.left_out.at(1).count, 2u);
    EXPECT_EQ(checked.left_out.at(1).first, "agent 1, node 1: occurs more than once");
  }
}

TEST_F(GraphCheckTest, LeavesOutOdometryThatSkipsNodes) {
  graph_.odometry = {Step(0, 1), Step(0, 2), Step(2, 0), Step(2, 1)};
  const CheckedGraph checked = Checked();
  EXPECT_EQ(checked.odometry.size(), 2u);
  EXPECT_EQ(checked.left_out.at(1).count, 2u);
  EXPECT_EQ(checked.left_out.at(1).first, "odometry from agent 1, node 0 to agent 1, node 2: skips agent 1, node 1");
}

TEST_F(GraphCheckTest, AcceptsABaseStationThatTheGraphAlreadyHas) {
  graph_.nodes.push_back(GraphNode{{4, 0}, 0, Pose{}});
  const CheckedGraph checked = Checked();
  EXPECT_EQ(checked.nodes.size(), 5u);
  EXPECT_TRUE(checked.left_out.empty());
}

TEST_F(GraphCheckTest, NormalisesQuaternions) {
  graph_.odometry = {Step(0, 1)};
  graph_.odometry[0].from_from_to.orientation.coeffs() *= 1.5;
  const CheckedGraph checked = Checked();
  ASSERT_EQ(checked.odometry.size(), 1u);
  EXPECT_NEAR(checked.odometry[0].from_from_to.orientation.norm(), 1, 1e-12);
}

TEST_F(GraphCheckTest, FindsTheGapsOfARoversOdometry) {
  graph_.odometry = {Step(0, 1)};
  const CheckedGraph checked = Checked();
  const std::vector<Rover> rovers = FindRovers(checked);
  ASSERT_EQ(rovers.size(), 2u);
  EXPECT_EQ(rovers[0].agent, 1u);
  EXPECT_EQ(rovers[0].count, 3u);
  EXPECT_THAT(rovers[0].part_heads, testing::ElementsAre(0, 2));
  EXPECT_THAT(rovers[1].part_heads, testing::ElementsAre(3));
}

}  // namespace
}  // namespace moondb
