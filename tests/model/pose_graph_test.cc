#include "model/pose_graph.h"

#include <gtest/gtest.h>

#include "model/record_check.h"

namespace moondb {
namespace {

const Pose kPose{Eigen::Vector3d(1, 2, 3), Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5)};

TEST(PoseGraphTest, RecordsBringEveryFieldBack) {
  Matrix6d covariance = Matrix6d::Identity() * 2;
  covariance(0, 5) = covariance(5, 0) = 0.25;
  covariance(1, 2) = covariance(2, 1) = -0.5;
  const proto::Record records[] = {ToRecord(GraphNode{{2, 7}, 11, kPose}),
                                   ToRecord(OdometryEdge{{2, 7}, {2, 8}, 12, kPose, covariance}),
                                   ToRecord(RangeEdge{{2, 7}, {4, 0}, 13, 9.5, 0.01})};
  PoseGraph graph;
  for (const proto::Record& record : records) {
    const Result<void> checked = CheckRecord(record);
    EXPECT_TRUE(checked) << ToString(checked.error());
    EXPECT_TRUE(AddRecord(record, graph));
  }
  ASSERT_EQ(graph.nodes.size(), 1u);
  EXPECT_EQ(graph.nodes[0].key, (NodeKey{2, 7}));
  EXPECT_EQ(graph.nodes[0].timestamp_ns, 11);
  EXPECT_EQ(graph.nodes[0].map_from_node.position_m, kPose.position_m);
  ASSERT_EQ(graph.odometry.size(), 1u);
  EXPECT_EQ(graph.odometry[0].covariance, covariance);
  EXPECT_EQ(graph.odometry[0].to, (NodeKey{2, 8}));
  EXPECT_EQ(graph.odometry[0].from_from_to.orientation.coeffs(), kPose.orientation.coeffs());
  ASSERT_EQ(graph.ranges.size(), 1u);
  EXPECT_EQ(graph.ranges[0].range_m, 9.5);
  EXPECT_EQ(graph.ranges[0].variance_m2, 0.01);
  EXPECT_EQ(graph.ranges[0].timestamp_ns, 13);
}

TEST(PoseGraphTest, RecordsBringLoopClosuresAndPriorsBack) {
  Matrix6d covariance = Matrix6d::Identity() * 2;
  covariance(0, 3) = covariance(3, 0) = 0.25;
  PoseGraph graph;
  const auto add = [&graph](const proto::Record& record) {
    const Result<void> checked = CheckRecord(record);
    EXPECT_TRUE(checked) << ToString(checked.error());
    EXPECT_TRUE(AddRecord(record, graph));
  };
  const LoopClosure closure{{2, 7}, {3, 1}, 14, kPose, covariance, "apriltag"};
  add(ToRecord(closure));
  ASSERT_EQ(graph.closures.size(), 1u);
  EXPECT_TRUE(graph.odometry.empty());
  EXPECT_EQ(KeyOf(graph.closures[0]), KeyOf(closure));
  EXPECT_EQ(graph.closures[0].covariance, covariance);
  EXPECT_EQ(graph.closures[0].timestamp_ns, 14);
  for (const PriorExtent extent : {PriorExtent::kPosition, PriorExtent::kPositionYaw, PriorExtent::kPose}) {
    const int size = static_cast<int>(extent);
    SCOPED_TRACE(size);
    NodePrior prior{{2, 7}, 15, extent, kPose, Matrix6d::Identity(), Eigen::Vector3d::Zero(), "gnss"};
    prior.covariance.topLeftCorner(size, size) = covariance.topLeftCorner(size, size);
    if (extent != PriorExtent::kPose) prior.point_m = {0.5, 0, 1};
    add(ToRecord(prior));
    const NodePrior& read = graph.priors.back();
    EXPECT_EQ(KeyOf(read), KeyOf(prior));
    EXPECT_EQ(read.extent, extent);
    EXPECT_EQ(read.covariance, prior.covariance);
    EXPECT_EQ(read.map_from_node.position_m, kPose.position_m);
    EXPECT_EQ(read.point_m, prior.point_m);
    EXPECT_NEAR(read.map_from_node.Yaw(), extent == PriorExtent::kPosition ? 0 : kPose.Yaw(), 1e-12);
  }
}

TEST(PoseGraphTest, AMapMatchIsALoopClosureOfTheSourceRegistration) {
  proto::Record record;
  record.set_timestamp_ns(12);
  proto::MapMatch& match = *record.mutable_map_match();
  *match.mutable_from() = ToProto(NodeKey{2, 7});
  *match.mutable_to() = ToProto(NodeKey{1, 3});
  *match.mutable_relative_pose()->mutable_from_from_to() = ToProto(kPose);
  PoseGraph graph;
  EXPECT_EQ(AddRecord(record, graph).error().field, "map_match.relative_pose.covariance");
  AddUpperTriangle(2 * Matrix6d::Identity(), *match.mutable_relative_pose()->mutable_covariance());
  ASSERT_TRUE(AddRecord(record, graph));
  ASSERT_EQ(graph.closures.size(), 1u);
  const LoopClosure& closure = graph.closures.front();
  EXPECT_EQ(KeyOf(closure), (FactorKey{FactorKind::kLoopClosure, {2, 7}, {1, 3}, "registration"}));
  EXPECT_EQ(closure.timestamp_ns, 12);
  EXPECT_EQ(closure.from_from_to.position_m, kPose.position_m);
  EXPECT_EQ(closure.covariance, 2 * Matrix6d::Identity());
}

TEST(PoseGraphTest, ASourceIsAShortNameThatIsNotReserved) {
  for (const char* const source : {"apriltag", "slam_toolbox", "gnss2", "a"}) EXPECT_TRUE(IsSource(source)) << source;
  for (const char* const source : {"", "odometry", "range", "prior", "registration", "AprilTag", "2d", "a b", "_a",
                                   "a2345678901234567890123456789012x"}) {
    EXPECT_FALSE(IsSource(source)) << source;
  }
}

TEST(PoseGraphTest, WithTiltKeepsPositionAndYaw) {
  NodePrior prior;
  prior.extent = PriorExtent::kPositionYaw;
  prior.covariance.topLeftCorner<4, 4>().diagonal() << 1, 2, 3, 4;
  prior.covariance(0, 3) = prior.covariance(3, 0) = 0.5;
  const NodePrior pose = WithTilt(prior);
  EXPECT_EQ(pose.extent, PriorExtent::kPose);
  EXPECT_EQ(pose.covariance(5, 5), 4);
  EXPECT_EQ(pose.covariance(0, 5), 0.5);
  EXPECT_EQ(pose.covariance(3, 3), 1);
  EXPECT_EQ(pose.covariance(0, 3), 0);
}

TEST(PoseGraphTest, OtherRecordsAreIgnoredAndBrokenOnesRefused) {
  PoseGraph graph;
  proto::Record temperature;
  temperature.mutable_temperature()->set_celsius(3);
  EXPECT_TRUE(AddRecord(temperature, graph));
  proto::Record edge = ToRecord(OdometryEdge{{2, 7}, {2, 8}, 12, kPose, Matrix6d::Identity()});
  edge.mutable_pose_graph_edge()->mutable_relative_pose()->mutable_covariance()->RemoveLast();
  EXPECT_EQ(AddRecord(edge, graph).error().field, "pose_graph_edge.relative_pose.covariance");
  edge.mutable_pose_graph_edge()->clear_measurement();
  EXPECT_FALSE(AddRecord(edge, graph));
  EXPECT_TRUE(graph.odometry.empty());
}

}  // namespace
}  // namespace moondb
