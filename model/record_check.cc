#include "model/record_check.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "model/event.h"
#include "model/geometry.h"
#include "model/record_key.h"
#include "model/term.h"
#include "model/text.h"
#include "model/traversability_map.h"

namespace moondb {

namespace {

constexpr double kRangeMaxM = 1e6;
constexpr int kCovarianceNumbers = 21;
constexpr std::size_t kHealthTextBytesMax = 1024;
constexpr std::size_t kQuarantineReasonBytesMax = 1024;

// The first broken rule wins; later calls keep it.
class Checker {
 public:
  void Require(bool is_met, const std::string& field, const std::string& text) {
    if (!is_met && result_) result_ = Fail(ErrorCode::kInvalid, text, field);
  }
  void Finite(double value, const std::string& field) { Require(std::isfinite(value), field, "is not finite"); }
  void Size(const std::string& bytes, std::size_t bytes_max, const std::string& field) {
    Require(bytes.size() <= bytes_max, field, "is longer than " + std::to_string(bytes_max) + " bytes");
  }
  void Ratio(double value, const std::string& field) {
    Require(value >= 0 && value <= 1, field, "must lie between 0 and 1");
  }
  void Agent(AgentId agent, const std::string& field) {
    Require(agent >= 1 && agent <= kAgentIdMax, field, "must be 1 to " + std::to_string(kAgentIdMax));
  }
  void Node(const proto::NodeKey& node, const std::string& field) { Agent(node.agent_id(), field + ".agent_id"); }
  void Term(const proto::Term& term, const std::string& field) {
    Agent(term.issuer(), field + ".issuer");
    Require(term.number() <= kTermNumberMax, field + ".number", "is from the far future");
  }
  void PoseOk(const proto::Pose& pose, const std::string& field) {
    const Result<Pose> read = FromProto(pose);
    if (!read) Require(false, field + "." + read.error().field, read.error().text);
  }
  void Stop(const Error& error, const std::string& prefix) { Require(false, prefix + "." + error.field, error.text); }
  Result<void> Take() { return result_; }

 private:
  Result<void> result_;
};

bool IsPositiveDefinite(const google::protobuf::RepeatedField<double>& upper_triangle) {
  Eigen::Matrix<double, 6, 6> covariance;
  int next = 0;
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      covariance(row, column) = covariance(column, row) = upper_triangle[next++];
    }
  }
  return covariance.allFinite() && Eigen::LLT<Eigen::Matrix<double, 6, 6>>(covariance).info() == Eigen::Success;
}

void CheckEdge(const proto::PoseGraphEdge& edge, Checker& check) {
  check.Node(edge.from(), "pose_graph_edge.from");
  check.Node(edge.to(), "pose_graph_edge.to");
  check.Require(FromProto(edge.from()) != FromProto(edge.to()), "pose_graph_edge.to", "is the same node as from");
  const bool is_one_agent = edge.from().agent_id() == edge.to().agent_id();
  switch (edge.measurement_case()) {
    case proto::PoseGraphEdge::kRelativePose: {
      check.Require(is_one_agent, "pose_graph_edge.to.agent_id", "odometry joins nodes of one agent");
      check.PoseOk(edge.relative_pose().from_from_to(), "pose_graph_edge.relative_pose.from_from_to");
      const auto& covariance = edge.relative_pose().covariance();
      check.Require(covariance.size() == kCovarianceNumbers && IsPositiveDefinite(covariance),
                    "pose_graph_edge.relative_pose.covariance", "must be 21 numbers, positive definite");
      break;
    }
    case proto::PoseGraphEdge::kRange:
      check.Require(!is_one_agent, "pose_graph_edge.to.agent_id", "a range joins nodes of two agents");
      check.Require(edge.range().range_m() >= 0 && edge.range().range_m() <= kRangeMaxM,
                    "pose_graph_edge.range.range_m", "must lie between 0 and 1e6 m");
      check.Require(edge.range().variance_m2() > 0 && std::isfinite(edge.range().variance_m2()),
                    "pose_graph_edge.range.variance_m2", "must be positive and finite");
      break;
    case proto::PoseGraphEdge::MEASUREMENT_NOT_SET:
      check.Require(false, "pose_graph_edge.measurement", "is missing");
  }
}

void CheckCustom(const proto::CustomRecord& custom, Checker& check) {
  check.Require(IsCustom(custom.data_type()), "custom.data_type",
                "must be " + std::to_string(kCustomDataTypeMin) + " to " + std::to_string(kCustomDataTypeMax));
  check.Size(custom.latest_key(), kCustomKeyBytesMax, "custom.latest_key");
  check.Size(custom.payload(), kCustomPayloadBytesMax, "custom.payload");
  check.Size(custom.metadata(), kCustomMetadataBytesMax, "custom.metadata");
  check.Require(IsUtf8(custom.metadata()), "custom.metadata", "is not UTF-8");
}

void CheckEvent(const proto::AgentEvent& event, Checker& check) {
  check.Require(event.kind() != proto::EVENT_KIND_UNSPECIFIED, "agent_event.kind", "is missing");
  check.Size(event.text(), kEventTextBytesMax, "agent_event.text");
  check.Require(IsUtf8(event.text()), "agent_event.text", "is not UTF-8");
  check.Size(event.by(), kEventByBytesMax, "agent_event.by");
  check.Require(IsUtf8(event.by()), "agent_event.by", "is not UTF-8");
}

void CheckQuarantine(const proto::MapQuarantine& quarantine, Checker& check) {
  check.Size(quarantine.reason(), kQuarantineReasonBytesMax, "map_quarantine.reason");
  check.Require(IsUtf8(quarantine.reason()), "map_quarantine.reason", "is not UTF-8");
  if (quarantine.has_lifts()) {
    const proto::RecordKey& lifted = quarantine.lifts();
    check.Agent(lifted.origin_agent(), "map_quarantine.lifts.origin_agent");
    check.Require(lifted.data_type() == proto::MAP_QUARANTINE, "map_quarantine.lifts.data_type",
                  "must be that of a quarantine");
    check.Require(lifted.epoch() != 0 && lifted.seq() >= 1 && lifted.seq() <= kSeqMax, "map_quarantine.lifts",
                  "names no shared record");
    return;
  }
  check.Agent(quarantine.agent_id(), "map_quarantine.agent_id");
  check.Require(quarantine.from_ns() <= quarantine.to_ns(), "map_quarantine.to_ns", "lies before from_ns");
}

std::string NodeText(const proto::NodeKey& node) {
  return std::to_string(node.agent_id()) + ":" + std::to_string(node.index());
}

std::string EdgeText(const proto::NodeKey& from, const proto::NodeKey& to, bool is_range) {
  return (is_range ? "range " : "odometry ") + NodeText(from) + " " + NodeText(to);
}

}  // namespace

DataType TypeOf(const proto::Record& record) {
  switch (record.body_case()) {
    case proto::Record::kTemperature:
      return proto::TEMPERATURE;
    case proto::Record::kPower:
      return proto::POWER;
    case proto::Record::kAwakeStatus:
      return proto::AWAKE_STATUS;
    case proto::Record::kMode:
      return proto::MODE;
    case proto::Record::kHealth:
      return proto::HEALTH;
    case proto::Record::kExploration:
      return proto::EXPLORATION;
    case proto::Record::kDistributedMeasurements:
      return proto::DISTRIBUTED_MEASUREMENTS;
    case proto::Record::kPoseGraphNode:
      return proto::POSE_GRAPH_NODE;
    case proto::Record::kPoseGraphEdge:
      return proto::POSE_GRAPH_EDGE;
    case proto::Record::kOptimizedPose:
      return proto::OPTIMIZED_POSE;
    case proto::Record::kEdgeVerdict:
      return proto::EDGE_VERDICT;
    case proto::Record::kLocalTraversabilityMap:
      return proto::LOCAL_TRAVERSABILITY_MAP;
    case proto::Record::kMapQuarantine:
      return proto::MAP_QUARANTINE;
    case proto::Record::kAgentEvent:
      return proto::AGENT_EVENT;
    case proto::Record::kCustom:
      if (IsCustom(record.custom().data_type())) return record.custom().data_type();
      return proto::DATA_TYPE_UNSPECIFIED;
    case proto::Record::BODY_NOT_SET:
      return proto::DATA_TYPE_UNSPECIFIED;
  }
  return proto::DATA_TYPE_UNSPECIFIED;
}

Result<void> CheckRecord(const proto::Record& record) {
  Checker check;
  switch (record.body_case()) {
    case proto::Record::kTemperature:
      check.Finite(record.temperature().celsius(), "temperature.celsius");
      break;
    case proto::Record::kPower:
      check.Ratio(record.power().battery_ratio(), "power.battery_ratio");
      check.Finite(record.power().draw_w(), "power.draw_w");
      break;
    case proto::Record::kAwakeStatus:
      break;
    case proto::Record::kMode:
      check.Require(proto::Activity_IsValid(record.mode().activity()), "mode.activity", "is unknown");
      break;
    case proto::Record::kHealth:
      check.Require(proto::HealthLevel_IsValid(record.health().level()), "health.level", "is unknown");
      check.Size(record.health().text(), kHealthTextBytesMax, "health.text");
      break;
    case proto::Record::kExploration:
      check.Ratio(record.exploration().explored_ratio(), "exploration.explored_ratio");
      break;
    case proto::Record::kDistributedMeasurements:
      check.Ratio(record.distributed_measurements().completed_ratio(), "distributed_measurements.completed_ratio");
      break;
    case proto::Record::kPoseGraphNode:
      check.Node(record.pose_graph_node().node(), "pose_graph_node.node");
      check.PoseOk(record.pose_graph_node().map_from_node(), "pose_graph_node.map_from_node");
      break;
    case proto::Record::kPoseGraphEdge:
      CheckEdge(record.pose_graph_edge(), check);
      break;
    case proto::Record::kOptimizedPose:
      check.Node(record.optimized_pose().node(), "optimized_pose.node");
      check.PoseOk(record.optimized_pose().map_from_node(), "optimized_pose.map_from_node");
      check.Term(record.optimized_pose().term(), "optimized_pose.term");
      break;
    case proto::Record::kEdgeVerdict:
      check.Node(record.edge_verdict().from(), "edge_verdict.from");
      check.Node(record.edge_verdict().to(), "edge_verdict.to");
      check.Finite(record.edge_verdict().residual_sigmas(), "edge_verdict.residual_sigmas");
      check.Term(record.edge_verdict().term(), "edge_verdict.term");
      break;
    case proto::Record::kLocalTraversabilityMap: {
      const Result<TraversabilityMap> map = FromProto(record.local_traversability_map());
      if (!map) check.Stop(map.error(), "local_traversability_map");
      break;
    }
    case proto::Record::kMapQuarantine:
      CheckQuarantine(record.map_quarantine(), check);
      break;
    case proto::Record::kAgentEvent:
      CheckEvent(record.agent_event(), check);
      break;
    case proto::Record::kCustom:
      CheckCustom(record.custom(), check);
      break;
    case proto::Record::BODY_NOT_SET:
      check.Require(false, "body", "is missing or of an unknown type");
  }
  return check.Take();
}

std::string LatestKey(const proto::Record& record) {
  if (record.has_custom()) return record.custom().latest_key();
  if (record.has_optimized_pose()) return NodeText(record.optimized_pose().node());
  if (record.has_edge_verdict()) {
    const proto::EdgeVerdict& verdict = record.edge_verdict();
    return EdgeText(verdict.from(), verdict.to(), verdict.is_range());
  }
  return {};
}

std::string NaturalKey(const proto::Record& record) {
  if (record.has_pose_graph_node()) return NodeText(record.pose_graph_node().node());
  if (record.has_pose_graph_edge()) {
    const proto::PoseGraphEdge& edge = record.pose_graph_edge();
    return EdgeText(edge.from(), edge.to(), edge.has_range());
  }
  return {};
}

}  // namespace moondb
