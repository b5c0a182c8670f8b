// PoseGraph: the nodes, odometry and ranges of a team, as plain values.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "model/error.h"
#include "model/geometry.h"
#include "model/ids.h"
#include "proto/record.pb.h"

namespace moondb {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

struct GraphNode {
  NodeKey key;
  std::int64_t timestamp_ns = 0;
  Pose map_from_node;  // Raw pose: start pose composed with odometry.
};

// One step of visual-inertial odometry.
struct OdometryEdge {
  NodeKey from;
  NodeKey to;
  std::int64_t timestamp_ns = 0;
  Pose from_from_to;
  Matrix6d covariance = Matrix6d::Identity();  // Translation first (m), then rotation (rad).
};

inline constexpr double kRangeMax_m = 1e6;

// One UWB range between the antennas of two agents: 0 to kRangeMax_m.
struct RangeEdge {
  NodeKey from;
  NodeKey to;
  std::int64_t timestamp_ns = 0;
  double range_m = 0;
  double variance_m2 = 1;
};

struct PoseGraph {
  std::vector<GraphNode> nodes;
  std::vector<OdometryEdge> odometry;
  std::vector<RangeEdge> ranges;
};

// Convert between a symmetric matrix and the 21 numbers of its upper triangle, row by row. FromUpperTriangle fails with
// kInvalid unless there are 21 numbers.
Result<Matrix6d> FromUpperTriangle(const google::protobuf::RepeatedField<double>& numbers);
void AddUpperTriangle(const Matrix6d& matrix, google::protobuf::RepeatedField<double>& numbers);

// Convert between graph elements and records. AddRecord adds the element in a record to `graph`, and ignores records of
// other types. Requires for AddRecord: CheckRecord(record) succeeds.
proto::Record ToRecord(const GraphNode& node);
proto::Record ToRecord(const OdometryEdge& edge);
proto::Record ToRecord(const RangeEdge& edge);
Result<void> AddRecord(const proto::Record& record, PoseGraph& graph);

}  // namespace moondb
