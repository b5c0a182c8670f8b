// PoseGraph: the nodes of a team and the measurements between them, as plain values.
#pragma once

#include <Eigen/Core>
#include <compare>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/geometry.h"
#include "model/ids.h"
#include "proto/record.pb.h"

namespace moondb {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Variances outside these bounds (m^2, rad^2) are no sensor's, and would spoil the numerical precision of a whole
// solve.
inline constexpr double kVarianceMin = 1e-12;
inline constexpr double kVarianceMax = 1e8;

// Returns the name of axis `i` of a covariance with `size` rows (PriorExtent): "x", "y", "z", "roll", "pitch", "yaw".
std::string AxisName(int i, int size);

// Scales each axis with a variance above kUnmeasuredVariance to this variance, so that a solve can use a measurement
// whose other axes are good, and raises variances below kVarianceMin.
void LimitVariances(Matrix6d& covariance);
inline constexpr double kUnmeasuredVariance = 1e6;

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
  AgentId producer = 0;  // Agent that inserted the record; 0 if unknown, for example in a graph from a file.
};

// A relative pose between any two nodes that is not odometry: a loop closure of one rover, or one rover's measurement
// of another. Loop closures may be wrong; the solver tests them.
struct LoopClosure {
  NodeKey from;
  NodeKey to;
  std::int64_t timestamp_ns = 0;
  Pose from_from_to;
  Matrix6d covariance = Matrix6d::Identity();  // As in OdometryEdge.
  std::string source;                          // Name of the software or sensor that measured it.
  AgentId producer = 0;                        // As in RangeEdge.
};

// How much of a node's pose a prior measures. The value is the size of the covariance.
enum class PriorExtent { kPosition = 3, kPositionYaw = 4, kPose = 6 };

// An absolute measurement of one node.
struct NodePrior {
  NodeKey node;
  std::int64_t timestamp_ns = 0;
  PriorExtent extent = PriorExtent::kPose;
  // The measured pose. Its orientation is the identity for kPosition, and a yaw for kPositionYaw.
  Pose map_from_node;
  // The first rows and columns, as many as `extent` says, are the covariance of the position in the frame `map` (m),
  // then of the yaw or of the rotation about the axes of `map` (rad). The other diagonal entries are 1.
  Matrix6d covariance = Matrix6d::Identity();
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();  // The measured point in the node's body frame.
  std::string source;                                 // As in LoopClosure.
  AgentId producer = 0;                               // As in RangeEdge.
};

// Returns a prior of a position and a yaw as a prior of a pose whose roll and pitch are 0 with a sigma of 1 rad, for
// file formats that have no such prior. Returns other priors unchanged.
NodePrior WithTilt(NodePrior prior);

struct PoseGraph {
  std::vector<GraphNode> nodes;
  std::vector<OdometryEdge> odometry;
  std::vector<RangeEdge> ranges;
  std::vector<LoopClosure> closures;
  std::vector<NodePrior> priors;
};

// The kinds of measurements that a solve may reject.
enum class FactorKind { kRange, kLoopClosure, kPrior };

// Identifies a measurement that a solve may reject.
struct FactorKey {
  FactorKind kind = FactorKind::kRange;
  NodeKey from;
  NodeKey to;          // Equals `from` for a prior.
  std::string source;  // Empty for a range.
  auto operator<=>(const FactorKey&) const = default;
};

FactorKey KeyOf(const RangeEdge& edge);
FactorKey KeyOf(const LoopClosure& closure);
FactorKey KeyOf(const NodePrior& prior);
FactorKey KeyOf(const proto::EdgeVerdict& verdict);
FactorKey KeyOf(const proto::QuarantinedFactor& factor);

// Returns "range", "loop closure" or "prior".
std::string ToString(FactorKind kind);

// Convert between the first `size` rows and columns of a symmetric matrix and the numbers of their upper triangle, row
// by row. FromUpperTriangle fills the rest with the identity, and fails with kInvalid unless there are size (size + 1)
// / 2 numbers.
Result<Matrix6d> FromUpperTriangle(const google::protobuf::RepeatedField<double>& numbers, int size = 6);
void AddUpperTriangle(const Matrix6d& matrix, google::protobuf::RepeatedField<double>& numbers, int size = 6);

inline constexpr std::size_t kSourceBytesMax = 32;

// The source of loop closures that a leader measured by matching local maps (proto/record.proto, MapMatch). Clients may
// not use it.
inline constexpr std::string_view kRegistrationSource = "registration";

// Returns whether `source` may name the producer of a loop closure or prior that a client inserts (proto/record.proto,
// PoseGraphEdge).
bool IsSource(std::string_view source);

// Convert between graph elements and records. AddRecord adds the element in a record to `graph`, and ignores records of
// other types. It adds a MapMatch as a loop closure of kRegistrationSource. Requires for AddRecord: CheckRecord(record)
// succeeds. Requires for ToRecord: a loop closure is not of kRegistrationSource.
proto::Record ToRecord(const GraphNode& node);
proto::Record ToRecord(const OdometryEdge& edge);
proto::Record ToRecord(const RangeEdge& edge);
proto::Record ToRecord(const LoopClosure& closure);
proto::Record ToRecord(const NodePrior& prior);
Result<void> AddRecord(const proto::Record& record, PoseGraph& graph);

}  // namespace moondb
