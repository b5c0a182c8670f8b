#include "apps/moondb_mission/measurement.h"

#include <gtest/gtest.h>

#include <cmath>

#include "apps/moondb_mission/drive.h"

namespace moondb {
namespace {

std::vector<GraphNode> NodesOf(const std::vector<TrackPoint>& track) {
  std::vector<GraphNode> nodes;
  for (std::size_t i = 0; i < track.size(); ++i) {
    nodes.push_back({{1, i},
                     static_cast<std::int64_t>(i),
                     Pose::FromPlanar(track[i].position_m.x(), track[i].position_m.y(), track[i].yaw_rad)});
  }
  return nodes;
}

TEST(MeasurementTest, OdometryDriftsByOneToTwoPercentOfTheWay) {
  double error_m = 0, driven_m = 0;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Random random(seed);
    const Terrain terrain = Terrain::Make(TerrainOptions(), random);
    for (const std::vector<TrackPoint>& track : DriveTeam(terrain, DriveOptions(), random)) {
      const std::vector<GraphNode> nodes = NodesOf(track);
      double way_m = 0;
      for (std::size_t i = 1; i < nodes.size(); ++i) {
        way_m += (nodes[i].map_from_node.position_m - nodes[i - 1].map_from_node.position_m).norm();
      }
      // The mean of many draws over one path hardly depends on the seed.
      for (int draw = 0; draw < 40; ++draw) {
        Pose pose = nodes.front().map_from_node;
        for (const OdometryEdge& edge : MeasureOdometry(nodes, OdometryOptions(), random)) {
          pose = pose * edge.from_from_to;
        }
        error_m += (pose.position_m - nodes.back().map_from_node.position_m).norm();
        driven_m += way_m;
      }
    }
  }
  RecordProperty("drift_percent", std::to_string(100 * error_m / driven_m));
  EXPECT_GT(error_m / driven_m, 0.01);
  EXPECT_LT(error_m / driven_m, 0.02);
}

TEST(MeasurementTest, StatedCovarianceIsThatOfTheNoise) {
  std::vector<GraphNode> nodes;
  for (std::uint64_t i = 0; i < 4000; ++i) {
    nodes.push_back({{1, i}, 0, Pose::FromPlanar(0.7 * static_cast<double>(i), 0, 0)});
  }
  OdometryOptions options;
  options.scale_sigma = 0;
  Random random(5);
  Eigen::Matrix<double, 6, 1> squares = Eigen::Matrix<double, 6, 1>::Zero();
  for (const OdometryEdge& edge : MeasureOdometry(nodes, options, random)) {
    Eigen::Matrix<double, 6, 1> error;
    error.head<3>() = edge.from_from_to.position_m - Eigen::Vector3d(0.7, 0, 0);
    error.tail<3>() = 2 * edge.from_from_to.orientation.vec();
    squares += error.cwiseAbs2().cwiseQuotient(edge.covariance.diagonal());
  }
  for (int i = 0; i < 6; ++i) EXPECT_NEAR(squares[i] / 3999, 1, 0.1) << i;
}

TEST(MeasurementTest, RangesAreBetweenAntennasWithBiasAndBursts) {
  std::vector<MissionAgent> agents(3);
  std::map<NodeKey, Pose> truth;
  constexpr int kNodes = 3000;
  for (int i = 0; i < 3; ++i) {
    agents[i].id = static_cast<AgentId>(i + 1);
    agents[i].antenna_m = Eigen::Vector3d(0, 0, i);
  }
  agents[2].is_base_station = true;
  truth[{3, 0}] = Pose::FromPlanar(0, 4, 0);
  for (std::uint64_t node = 0; node < kNodes; ++node) {
    truth[{1, node}] = Pose::FromPlanar(0, 0, 0);
    truth[{2, node}] = Pose::FromPlanar(100, 0, 0);
  }
  RangeOptions options;
  Random random(6);
  const std::vector<RangeEdge> ranges = MeasureRanges(agents, truth, kNodes, 10, options, random);
  ASSERT_EQ(ranges.size(), 1000u);  // One range at every third node of rover 1. Other pairs are over 40 m apart.
  const double true_m = std::sqrt(4.0 * 4 + 2 * 2);
  double too_long = 0, too_short = 0, good_sum = 0, good = 0;
  for (const RangeEdge& range : ranges) {
    EXPECT_EQ(range.to, (NodeKey{3, 0}));
    EXPECT_EQ(range.from.index % 3, 0u);
    EXPECT_EQ(range.timestamp_ns, static_cast<std::int64_t>(range.from.index) * 10);
    EXPECT_DOUBLE_EQ(range.variance_m2, 0.01);
    const double error_m = range.range_m - true_m;
    too_long += error_m > 0.8;
    too_short += error_m < -0.8;
    if (std::abs(error_m) < 0.8) good_sum += error_m, good += 1;
  }
  EXPECT_EQ(too_short, 0);
  EXPECT_GT(too_long, 10);
  EXPECT_LT(too_long, 120);
  EXPECT_LT(std::abs(good_sum / good), 0.4);
  EXPECT_GT(std::abs(good_sum / good), 0.005);  // The bias of the pair does not average out.
}

}  // namespace
}  // namespace moondb
