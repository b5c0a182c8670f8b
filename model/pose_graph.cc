#include "model/pose_graph.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

namespace moondb {

namespace {

constexpr int TriangleNumbers(int size) { return size * (size + 1) / 2; }

// ReadCovariance and ReadPose name the field in an error by its path in the record.
Result<Matrix6d> ReadCovariance(const google::protobuf::RepeatedField<double>& numbers, int size,
                                const std::string& field) {
  Result<Matrix6d> covariance = FromUpperTriangle(numbers, size);
  if (!covariance) return Fail(covariance.error().code, covariance.error().text, field);
  return covariance;
}

Result<Pose> ReadPose(const proto::Pose& message, const std::string& field) {
  Result<Pose> pose = FromProto(message);
  if (!pose) return Fail(pose.error().code, pose.error().text, field + "." + pose.error().field);
  return pose;
}

// Returns a loop closure with only its pose and covariance.
Result<LoopClosure> ReadRelativePose(const proto::RelativePose& message, const std::string& field) {
  const Result<Pose> pose = ReadPose(message.from_from_to(), field + ".from_from_to");
  if (!pose) return tl::unexpected(pose.error());
  const Result<Matrix6d> covariance = ReadCovariance(message.covariance(), 6, field + ".covariance");
  if (!covariance) return tl::unexpected(covariance.error());
  LoopClosure closure;
  closure.from_from_to = *pose;
  closure.covariance = *covariance;
  return closure;
}

Eigen::Vector3d VectorOf(const proto::Vector3& vector) { return {vector.x(), vector.y(), vector.z()}; }

proto::Vector3 VectorMessage(const Eigen::Vector3d& vector) {
  proto::Vector3 message;
  message.set_x(vector.x());
  message.set_y(vector.y());
  message.set_z(vector.z());
  return message;
}

Result<void> AddNode(const proto::Record& record, PoseGraph& graph) {
  const proto::PoseGraphNode& node = record.pose_graph_node();
  const Result<Pose> pose = ReadPose(node.map_from_node(), "pose_graph_node.map_from_node");
  if (!pose) return tl::unexpected(pose.error());
  graph.nodes.push_back(GraphNode{FromProto(node.node()), record.timestamp_ns(), *pose});
  return {};
}

Result<void> AddEdge(const proto::Record& record, PoseGraph& graph) {
  const proto::PoseGraphEdge& edge = record.pose_graph_edge();
  const NodeKey from = FromProto(edge.from());
  const NodeKey to = FromProto(edge.to());
  if (edge.has_range()) {
    graph.ranges.push_back({from, to, record.timestamp_ns(), edge.range().range_m(), edge.range().variance_m2()});
    return {};
  }
  if (!edge.has_relative_pose()) return Fail(ErrorCode::kInvalid, "is missing", "pose_graph_edge.measurement");
  Result<LoopClosure> closure = ReadRelativePose(edge.relative_pose(), "pose_graph_edge.relative_pose");
  if (!closure) return tl::unexpected(closure.error());
  if (edge.source().empty()) {
    graph.odometry.push_back({from, to, record.timestamp_ns(), closure->from_from_to, closure->covariance});
  } else {
    graph.closures.push_back(
        {from, to, record.timestamp_ns(), closure->from_from_to, closure->covariance, edge.source()});
  }
  return {};
}

Result<void> AddMatch(const proto::Record& record, PoseGraph& graph) {
  const proto::MapMatch& match = record.map_match();
  Result<LoopClosure> closure = ReadRelativePose(match.relative_pose(), "map_match.relative_pose");
  if (!closure) return tl::unexpected(closure.error());
  closure->from = FromProto(match.from());
  closure->to = FromProto(match.to());
  closure->timestamp_ns = record.timestamp_ns();
  closure->source = kRegistrationSource;
  graph.closures.push_back(*std::move(closure));
  return {};
}

Result<void> AddPrior(const proto::Record& record, PoseGraph& graph) {
  const proto::PosePrior& body = record.pose_prior();
  NodePrior prior;
  prior.node = FromProto(body.node());
  prior.timestamp_ns = record.timestamp_ns();
  prior.point_m = VectorOf(body.point_m());
  prior.source = body.source();
  switch (body.measurement_case()) {
    case proto::PosePrior::kPositionM:
      prior.extent = PriorExtent::kPosition;
      prior.map_from_node.position_m = VectorOf(body.position_m());
      break;
    case proto::PosePrior::kPositionYaw:
      prior.extent = PriorExtent::kPositionYaw;
      prior.map_from_node = Pose::FromPlanar(0, 0, body.position_yaw().yaw_rad());
      prior.map_from_node.position_m = VectorOf(body.position_yaw().position_m());
      break;
    case proto::PosePrior::kPose: {
      const Result<Pose> pose = ReadPose(body.pose(), "pose_prior.pose");
      if (!pose) return tl::unexpected(pose.error());
      prior.map_from_node = *pose;
      break;
    }
    case proto::PosePrior::MEASUREMENT_NOT_SET:
      return Fail(ErrorCode::kInvalid, "is missing", "pose_prior.measurement");
  }
  const Result<Matrix6d> covariance =
      ReadCovariance(body.covariance(), static_cast<int>(prior.extent), "pose_prior.covariance");
  if (!covariance) return tl::unexpected(covariance.error());
  prior.covariance = *covariance;
  graph.priors.push_back(std::move(prior));
  return {};
}

// Returns a record of an edge with these ends.
proto::Record EdgeRecord(const NodeKey& from, const NodeKey& to, std::int64_t timestamp_ns) {
  proto::Record record;
  record.set_timestamp_ns(timestamp_ns);
  *record.mutable_pose_graph_edge()->mutable_from() = ToProto(from);
  *record.mutable_pose_graph_edge()->mutable_to() = ToProto(to);
  return record;
}

// Returns the factor that a verdict or a quarantine names.
template <typename Message>
FactorKey KeyInMessage(const Message& message) {
  const FactorKind kind = message.is_range()   ? FactorKind::kRange
                          : message.is_prior() ? FactorKind::kPrior
                                               : FactorKind::kLoopClosure;
  return {kind, FromProto(message.from()), FromProto(message.to()), message.source()};
}

void SetRelativePose(const Pose& from_from_to, const Matrix6d& covariance, proto::Record& record) {
  proto::RelativePose& relative_pose = *record.mutable_pose_graph_edge()->mutable_relative_pose();
  *relative_pose.mutable_from_from_to() = ToProto(from_from_to);
  AddUpperTriangle(covariance, *relative_pose.mutable_covariance());
}

}  // namespace

std::string AxisName(int i, int size) {
  if (i < 3) return std::string(1, "xyz"[i]);
  constexpr const char* kRotations[] = {"roll", "pitch", "yaw"};
  return size == static_cast<int>(PriorExtent::kPositionYaw) ? "yaw" : kRotations[i - 3];
}

void LimitVariances(Matrix6d& covariance) {
  for (int i = 0; i < 6; ++i) {
    const double variance = covariance(i, i);
    if (!(variance > kUnmeasuredVariance)) continue;
    const double scale = std::sqrt(kUnmeasuredVariance / variance);
    covariance.row(i) *= scale;
    covariance.col(i) *= scale;
  }
  const double smallest = Eigen::LLT<Matrix6d>(covariance).matrixLLT().diagonal().cwiseAbs2().minCoeff();
  if (smallest < kVarianceMin) covariance.diagonal().array() += 2 * kVarianceMin;
}

NodePrior WithTilt(NodePrior prior) {
  if (prior.extent != PriorExtent::kPositionYaw) return prior;
  const Eigen::Matrix4d measured = prior.covariance.topLeftCorner<4, 4>();
  prior.extent = PriorExtent::kPose;
  prior.covariance.setIdentity();
  prior.covariance.topLeftCorner<3, 3>() = measured.topLeftCorner<3, 3>();
  prior.covariance.block<3, 1>(0, 5) = measured.block<3, 1>(0, 3);
  prior.covariance.block<1, 3>(5, 0) = measured.block<1, 3>(3, 0);
  prior.covariance(5, 5) = measured(3, 3);
  return prior;
}

FactorKey KeyOf(const RangeEdge& edge) { return {FactorKind::kRange, edge.from, edge.to, {}}; }

FactorKey KeyOf(const LoopClosure& closure) {
  return {FactorKind::kLoopClosure, closure.from, closure.to, closure.source};
}

FactorKey KeyOf(const NodePrior& prior) { return {FactorKind::kPrior, prior.node, prior.node, prior.source}; }

FactorKey KeyOf(const proto::EdgeVerdict& verdict) { return KeyInMessage(verdict); }

FactorKey KeyOf(const proto::QuarantinedFactor& factor) { return KeyInMessage(factor); }

std::string ToString(FactorKind kind) {
  switch (kind) {
    case FactorKind::kRange:
      return "range";
    case FactorKind::kLoopClosure:
      return "loop closure";
    case FactorKind::kPrior:
      return "prior";
  }
  return "unknown";
}

Result<Matrix6d> FromUpperTriangle(const google::protobuf::RepeatedField<double>& numbers, int size) {
  if (numbers.size() != TriangleNumbers(size)) {
    return Fail(ErrorCode::kInvalid, "has " + std::to_string(numbers.size()) + " numbers instead of " +
                                         std::to_string(TriangleNumbers(size)));
  }
  Matrix6d matrix = Matrix6d::Identity();
  int next = 0;
  for (int row = 0; row < size; ++row) {
    for (int column = row; column < size; ++column) matrix(row, column) = matrix(column, row) = numbers[next++];
  }
  return matrix;
}

void AddUpperTriangle(const Matrix6d& matrix, google::protobuf::RepeatedField<double>& numbers, int size) {
  numbers.Reserve(numbers.size() + TriangleNumbers(size));
  for (int row = 0; row < size; ++row) {
    for (int column = row; column < size; ++column) numbers.Add(matrix(row, column));
  }
}

bool IsSource(std::string_view source) {
  constexpr std::array<std::string_view, 4> kReserved = {"odometry", "range", "prior", kRegistrationSource};
  const auto is_letter = [](char c) { return c >= 'a' && c <= 'z'; };
  const auto is_allowed = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; };
  return !source.empty() && source.size() <= kSourceBytesMax && is_letter(source.front()) &&
         std::ranges::all_of(source, is_allowed) && std::ranges::find(kReserved, source) == kReserved.end();
}

proto::Record ToRecord(const GraphNode& node) {
  proto::Record record;
  record.set_timestamp_ns(node.timestamp_ns);
  proto::PoseGraphNode& body = *record.mutable_pose_graph_node();
  *body.mutable_node() = ToProto(node.key);
  *body.mutable_map_from_node() = ToProto(node.map_from_node);
  return record;
}

proto::Record ToRecord(const OdometryEdge& edge) {
  proto::Record record = EdgeRecord(edge.from, edge.to, edge.timestamp_ns);
  SetRelativePose(edge.from_from_to, edge.covariance, record);
  return record;
}

proto::Record ToRecord(const RangeEdge& edge) {
  proto::Record record = EdgeRecord(edge.from, edge.to, edge.timestamp_ns);
  proto::Range& range = *record.mutable_pose_graph_edge()->mutable_range();
  range.set_range_m(edge.range_m);
  range.set_variance_m2(edge.variance_m2);
  return record;
}

proto::Record ToRecord(const LoopClosure& closure) {
  proto::Record record = EdgeRecord(closure.from, closure.to, closure.timestamp_ns);
  SetRelativePose(closure.from_from_to, closure.covariance, record);
  record.mutable_pose_graph_edge()->set_source(closure.source);
  return record;
}

proto::Record ToRecord(const NodePrior& prior) {
  proto::Record record;
  record.set_timestamp_ns(prior.timestamp_ns);
  proto::PosePrior& body = *record.mutable_pose_prior();
  *body.mutable_node() = ToProto(prior.node);
  switch (prior.extent) {
    case PriorExtent::kPosition:
      *body.mutable_position_m() = VectorMessage(prior.map_from_node.position_m);
      break;
    case PriorExtent::kPositionYaw:
      *body.mutable_position_yaw()->mutable_position_m() = VectorMessage(prior.map_from_node.position_m);
      body.mutable_position_yaw()->set_yaw_rad(prior.map_from_node.Yaw());
      break;
    case PriorExtent::kPose:
      *body.mutable_pose() = ToProto(prior.map_from_node);
      break;
  }
  AddUpperTriangle(prior.covariance, *body.mutable_covariance(), static_cast<int>(prior.extent));
  if (!prior.point_m.isZero(0)) *body.mutable_point_m() = VectorMessage(prior.point_m);
  body.set_source(prior.source);
  return record;
}

Result<void> AddRecord(const proto::Record& record, PoseGraph& graph) {
  if (record.has_pose_graph_node()) return AddNode(record, graph);
  if (record.has_pose_graph_edge()) return AddEdge(record, graph);
  if (record.has_pose_prior()) return AddPrior(record, graph);
  if (record.has_map_match()) return AddMatch(record, graph);
  return {};
}

}  // namespace moondb
