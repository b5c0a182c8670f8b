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
