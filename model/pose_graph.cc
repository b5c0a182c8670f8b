#include "model/pose_graph.h"

#include <string>

namespace moondb {

namespace {

constexpr int kDimensions = 6;
constexpr int kTriangleNumbers = kDimensions * (kDimensions + 1) / 2;

Result<void> AddNode(const proto::Record& record, PoseGraph& graph) {
  const proto::PoseGraphNode& node = record.pose_graph_node();
  const Result<Pose> pose = FromProto(node.map_from_node());
  if (!pose) return Fail(pose.error().code, pose.error().text, "pose_graph_node.map_from_node." + pose.error().field);
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
  const Result<Pose> pose = FromProto(edge.relative_pose().from_from_to());
  if (!pose) {
    return Fail(pose.error().code, pose.error().text,
                "pose_graph_edge.relative_pose.from_from_to." + pose.error().field);
  }
  const Result<Matrix6d> covariance = FromUpperTriangle(edge.relative_pose().covariance());
  if (!covariance) {
    return Fail(covariance.error().code, covariance.error().text, "pose_graph_edge.relative_pose.covariance");
  }
  graph.odometry.push_back(OdometryEdge{from, to, record.timestamp_ns(), *pose, *covariance});
  return {};
}

}  // namespace

Result<Matrix6d> FromUpperTriangle(const google::protobuf::RepeatedField<double>& numbers) {
  if (numbers.size() != kTriangleNumbers) {
    return Fail(ErrorCode::kInvalid, "has " + std::to_string(numbers.size()) + " numbers instead of 21");
  }
  Matrix6d matrix;
  int next = 0;
  for (int row = 0; row < kDimensions; ++row) {
    for (int column = row; column < kDimensions; ++column) matrix(row, column) = matrix(column, row) = numbers[next++];
  }
  return matrix;
}

void AddUpperTriangle(const Matrix6d& matrix, google::protobuf::RepeatedField<double>& numbers) {
  numbers.Reserve(numbers.size() + kTriangleNumbers);
  for (int row = 0; row < kDimensions; ++row) {
    for (int column = row; column < kDimensions; ++column) numbers.Add(matrix(row, column));
  }
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
  proto::Record record;
  record.set_timestamp_ns(edge.timestamp_ns);
  proto::PoseGraphEdge& body = *record.mutable_pose_graph_edge();
  *body.mutable_from() = ToProto(edge.from);
  *body.mutable_to() = ToProto(edge.to);
  proto::RelativePose& relative_pose = *body.mutable_relative_pose();
  *relative_pose.mutable_from_from_to() = ToProto(edge.from_from_to);
  AddUpperTriangle(edge.covariance, *relative_pose.mutable_covariance());
  return record;
}

proto::Record ToRecord(const RangeEdge& edge) {
  proto::Record record;
  record.set_timestamp_ns(edge.timestamp_ns);
  proto::PoseGraphEdge& body = *record.mutable_pose_graph_edge();
  *body.mutable_from() = ToProto(edge.from);
  *body.mutable_to() = ToProto(edge.to);
  body.mutable_range()->set_range_m(edge.range_m);
  body.mutable_range()->set_variance_m2(edge.variance_m2);
  return record;
}

Result<void> AddRecord(const proto::Record& record, PoseGraph& graph) {
  if (record.has_pose_graph_node()) return AddNode(record, graph);
  if (record.has_pose_graph_edge()) return AddEdge(record, graph);
  return {};
}

}  // namespace moondb
