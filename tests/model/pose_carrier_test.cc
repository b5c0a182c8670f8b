#include "model/pose_carrier.h"

#include <gtest/gtest.h>

#include <numbers>

#include "model/node_poses.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

RecordKey NodeRecord(AgentId agent, std::uint64_t index) { return {{agent, 7, proto::POSE_GRAPH_NODE}, index + 1}; }

class PoseCarrierTest : public testing::Test {
 protected:
  void AddRaw(std::uint64_t index, const Pose& pose, AgentId agent = 1) {
    poses_.AddRaw(NodeRecord(agent, index), {agent, index}, pose);
  }
  // Nodes 0 to `last` along x, one metre apart.
  void AddDrive(std::uint64_t last, AgentId agent = 1) {
    for (std::uint64_t i = 0; i <= last; ++i) AddRaw(i, Pose::FromPlanar(static_cast<double>(i), 0, 0), agent);
  }
  void AddOptimized(std::uint64_t index, const NodePoses::OptimizedPose& pose, std::uint64_t run = 1,
                    AgentId agent = 1) {
    proto::Term term;
    term.set_number(1);
    term.set_issuer(1);
    poses_.AddOptimized({{1, 7, proto::OPTIMIZED_POSE}, 100 * run + index}, {agent, index}, pose, term, run);
  }
  const ValidPose* Find(std::uint64_t index, AgentId agent = 1) {
    valid_ = poses_.FindValid(quarantined_);
    return valid_.Find({agent, index});
  }

  NodePoses poses_{1000};
  std::set<NodeKey> quarantined_;
  NodePoses::ValidPoses valid_;
};

TEST_F(PoseCarrierTest, NodesAfterASolveKeepTheirOdometryFromItsLastNode) {
  AddDrive(4);
  AddOptimized(1, {Pose::FromPlanar(10, 5, std::numbers::pi / 2)});
  EXPECT_EQ(Find(0)->source, PoseSource::kRaw);
  EXPECT_EQ(Find(1)->source, PoseSource::kOptimized);
  const ValidPose* carried = Find(4);
  EXPECT_EQ(carried->source, PoseSource::kCarried);
  EXPECT_LT((carried->map_from_node.position_m - Eigen::Vector3d(10, 8, 0)).norm(), 1e-9) << "3 m on, along y now";
  EXPECT_NEAR(carried->map_from_node.Yaw(), std::numbers::pi / 2, 1e-9);
  EXPECT_TRUE(valid_.cut_at.empty());
}

TEST_F(PoseCarrierTest, ANewerSolveMovesTheNodesAfterIt) {
  AddDrive(4);
  AddOptimized(1, {Pose::FromPlanar(10, 5, 0)});
  AddOptimized(1, {Pose::FromPlanar(20, 5, 0)}, /*run=*/2);
  EXPECT_NEAR(Find(4)->map_from_node.position_m.x(), 23, 1e-9);
  AddOptimized(3, {Pose::FromPlanar(30, 0, 0)}, /*run=*/2);
  EXPECT_NEAR(Find(4)->map_from_node.position_m.x(), 31, 1e-9);
  EXPECT_NEAR(Find(2)->map_from_node.position_m.x(), 21, 1e-9);
}

TEST_F(PoseCarrierTest, NothingIsCarriedOverAMissingNode) {
  AddDrive(1);
  AddOptimized(1, {Pose::FromPlanar(10, 0, 0)});
  AddRaw(3, Pose::FromPlanar(3, 0, 0));
  AddRaw(4, Pose::FromPlanar(4, 0, 0));
  EXPECT_EQ(Find(3), nullptr);
  EXPECT_EQ(Find(4), nullptr);
  EXPECT_EQ(valid_.cut_at, (std::map<AgentId, std::uint64_t>{{1, 3}}));
  AddOptimized(4, {Pose::FromPlanar(14, 0, 0)}, /*run=*/2);
  AddRaw(5, Pose::FromPlanar(5, 0, 0));
  EXPECT_EQ(Find(3), nullptr) << "still without a pose";
  EXPECT_NEAR(Find(5)->map_from_node.position_m.x(), 15, 1e-9);
  EXPECT_TRUE(valid_.cut_at.empty()) << "the newest nodes have poses";
  AddRaw(2, Pose::FromPlanar(2, 0, 0));
  EXPECT_NEAR(Find(3)->map_from_node.position_m.x(), 12, 1e-9) << "the missing node has arrived";
}

TEST_F(PoseCarrierTest, NothingIsCarriedOverAStepOfMoreThanTwentyMetres) {
  AddDrive(1);
  AddOptimized(1, {Pose::FromPlanar(10, 0, 0)});
  AddRaw(2, Pose::FromPlanar(1 + kCarriedStep_m, 0, 0));
  EXPECT_EQ(Find(2)->source, PoseSource::kCarried);
  AddRaw(3, Pose::FromPlanar(0.5, 0, 0));
  AddRaw(4, Pose::FromPlanar(1.5, 0, 0));
  EXPECT_EQ(Find(3), nullptr) << "20.5 m: odometry began again";
  EXPECT_EQ(Find(4), nullptr);
}

TEST_F(PoseCarrierTest, AQuarantinedNodeIsNoBaseAndNoLink) {
  AddDrive(4);
  AddOptimized(1, {Pose::FromPlanar(10, 0, 0)});
  AddOptimized(2, {Pose::FromPlanar(50, 0, 0)});
  quarantined_ = {{1, 2}};
  EXPECT_EQ(Find(2), nullptr);
  EXPECT_EQ(Find(3), nullptr);
  AddOptimized(2, {Pose::FromPlanar(12, 0, 0), /*ignores_raw_pose=*/true}, /*run=*/2);
  EXPECT_EQ(Find(2)->source, PoseSource::kOptimized);
  EXPECT_EQ(Find(3), nullptr) << "the quarantine forbids the raw pose, which odometry starts from";
}

TEST_F(PoseCarrierTest, ANodeWithoutARawPoseIsNoBase) {
  AddRaw(0, Pose::FromPlanar(0, 0, 0));
  AddOptimized(0, {Pose::FromPlanar(10, 0, 0)});
  AddOptimized(1, {Pose::FromPlanar(11, 0, 0)});
  AddRaw(2, Pose::FromPlanar(2, 0, 0));
  EXPECT_EQ(Find(2), nullptr);
}

TEST_F(PoseCarrierTest, APoseCarriedFromAnUnplacedRoverIsUnplaced) {
  AddDrive(2);
  AddOptimized(1, {Pose::FromPlanar(10, 0, 0), false, /*is_unplaced=*/true});
  EXPECT_TRUE(Find(2)->is_unplaced);
}

TEST_F(PoseCarrierTest, RoversDoNotContinueEachOther) {
  AddDrive(2, 1);
  AddOptimized(2, {Pose::FromPlanar(10, 0, 0)}, 1, 1);
  AddDrive(3, 2);
  EXPECT_EQ(Find(3, 2)->source, PoseSource::kRaw);
  EXPECT_NEAR(Find(3, 2)->map_from_node.position_m.x(), 3, 1e-12);
}

}  // namespace
}  // namespace moondb
