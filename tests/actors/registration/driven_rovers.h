// Rovers that drive through generated worlds, with their records, for tests of submaps.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <map>
#include <random>
#include <vector>

#include "actors/registration/known_maps.h"
#include "actors/registration/planar_offset.h"
#include "model/pose_graph.h"
#include "proto/types.pb.h"
#include "tests/actors/registration/hazard_world.h"

namespace moondb {

// A drive from point to point, with a node each metre.
inline std::vector<PlanarOffset> Along(const std::vector<Eigen::Vector2d>& corners_m) {
  std::vector<PlanarOffset> poses;
  for (std::size_t i = 0; i + 1 < corners_m.size(); ++i) {
    const Eigen::Vector2d leg_m = corners_m[i + 1] - corners_m[i];
    const double yaw_rad = std::atan2(leg_m.y(), leg_m.x());
    for (double at_m = 0; at_m < leg_m.norm(); at_m += 1) {
      const Eigen::Vector2d place_m = corners_m[i] + at_m * leg_m.normalized();
      poses.push_back({place_m.x(), place_m.y(), yaw_rad});
    }
  }
  return poses;
}

class DrivenRovers : public testing::Test {
 protected:
  DrivenRovers() : maps_(Options()) {}

  static KnownMaps::Options Options() {
    KnownMaps::Options options;
    options.rovers = {1, 2, 3};
    return options;
  }

  // Drives rover `agent` along true poses in a world. Its own frame lies at `own_from_map` of the true one. Each second
  // node has a map.
  void Drive(AgentId agent, const HazardWorld& world, const std::vector<PlanarOffset>& poses,
             const Pose& own_from_map) {
    std::mt19937_64 random(agent);
    std::normal_distribution<double> error(0, 1);
    PlanarOffset raw = PlanarOffset::From(own_from_map) * poses.front();
    for (std::size_t i = 0; i < poses.size(); ++i) {
      const NodeKey node{agent, i};
      if (i > 0) {
        const PlanarOffset step = poses[i - 1].Inverse() * poses[i];
        raw = raw * PlanarOffset{step.x_m + 0.01 * error(random), step.y_m + 0.01 * error(random),
                                 step.yaw_rad + 0.003 * error(random)};
        OdometryEdge edge;
        edge.from = {agent, i - 1};
        edge.to = node;
        edge.covariance.diagonal() << 1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-5;
        Add(agent, proto::POSE_GRAPH_EDGE, ToRecord(edge));
      }
      const std::int64_t timestamp_ns = 1'000'000'000'000 * agent + static_cast<std::int64_t>(i) * 1'000'000'000;
      Add(agent, proto::POSE_GRAPH_NODE, ToRecord(GraphNode{node, timestamp_ns, raw.ToPose()}));
      proto::Record solved;
      *solved.mutable_optimized_pose()->mutable_node() = ToProto(node);
      *solved.mutable_optimized_pose()->mutable_map_from_node() = ToProto(raw.ToPose());
      Add(1, proto::OPTIMIZED_POSE, solved);
      truth_[node] = poses[i];
      if (i % 2 == 0) AddMap(node, world, poses[i], timestamp_ns);
    }
  }

  void AddMap(const NodeKey& node, const HazardWorld& world, const PlanarOffset& pose, std::int64_t timestamp_ns) {
    const TraversabilityMap map = world.MapAt(pose.ToPose(), node);
    proto::Record record;
    record.set_timestamp_ns(timestamp_ns);
    *record.mutable_local_traversability_map() = ToProto(map);
    Add(node.agent, proto::LOCAL_TRAVERSABILITY_MAP, record);
  }

  void Add(AgentId origin, DataType type, const proto::Record& record) {
    EXPECT_TRUE(maps_.Add({{origin, 7, type}, ++seq_}, record));
  }

  KnownMaps maps_;
  std::map<NodeKey, PlanarOffset> truth_;
  std::uint64_t seq_ = 0;
};

inline const std::vector<PlanarOffset>& Loop() {
  static const auto poses = Along({{-12, -10}, {12, -10}, {12, 10}, {-12, 10}});
  return poses;
}
inline const std::vector<PlanarOffset>& Back() {
  static const auto poses = Along({{10, 12}, {10, -9}, {-10, -9}});
  return poses;
}

}  // namespace moondb
