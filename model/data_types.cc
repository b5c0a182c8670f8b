#include "model/data_types.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "model/event.h"
#include "model/pose_graph.h"
#include "model/record_key.h"
#include "model/text.h"
#include "model/traversability_map.h"
#include "proto/policy.pb.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

using proto::Record;

constexpr std::size_t kHealthTextBytesMax = 1024;
constexpr std::size_t kQuarantineReasonBytesMax = 1024;
constexpr double kMapMatchDistanceMax_m = 1000;  // Matched maps overlap, and a local map is far smaller than this.

// Requires a positive definite covariance of `size` rows.
void CheckCovariance(const google::protobuf::RepeatedField<double>& upper_triangle, int size, const std::string& field,
                     FieldChecker& check) {
  const Result<Matrix6d> covariance = FromUpperTriangle(upper_triangle, size);
  const bool is_valid =
      covariance && covariance->allFinite() && Eigen::LLT<Matrix6d>(*covariance).info() == Eigen::Success;
  std::string text = "must be " + std::to_string(size * (size + 1) / 2) + " numbers of a positive definite matrix";
  for (int i = size - 1; covariance && i >= 0; --i) {
    const double variance = (*covariance)(i, i);
    if (variance > 0 && std::isfinite(variance)) continue;
    text = "the variance of " + AxisName(i, size) + " is " + FormatDouble(variance) +
           "; if the driver gives none, set one that fits the sensor (docs/SENSORS.md)";
  }
  check.Require(is_valid, field, text);
}

void CheckSource(const std::string& source, const std::string& field, FieldChecker& check) {
  check.Require(IsSource(source), field,
                "must be 1 to 32 of a-z, 0-9 and _, from a letter on, and not odometry, range, prior or registration");
}

void CheckRelativePose(const proto::RelativePose& pose, const std::string& field, FieldChecker& check) {
  check.Pose(pose.from_from_to(), field + ".from_from_to");
  CheckCovariance(pose.covariance(), 6, field + ".covariance", check);
}

// Requires the key of a record that agents share.
void CheckSharedKey(const proto::RecordKey& key, const std::string& field, FieldChecker& check) {
  check.Require(key.epoch() != 0 && key.seq() >= 1 && key.seq() <= kSeqMax, field,
                "must be the key of a shared record");
}

void CheckRange(const proto::Range& range, FieldChecker& check) {
  check.Require(range.range_m() >= 0 && range.range_m() <= kRangeMax_m, "pose_graph_edge.range.range_m",
                "must lie between 0 and 1e6 m");
  check.Require(range.variance_m2() > 0 && std::isfinite(range.variance_m2()), "pose_graph_edge.range.variance_m2",
                "must be positive and finite");
}

void CheckEdge(const Record& record, FieldChecker& check) {
  const proto::PoseGraphEdge& edge = record.pose_graph_edge();
  check.Node(edge.from(), "pose_graph_edge.from");
  check.Node(edge.to(), "pose_graph_edge.to");
  check.Require(FromProto(edge.from()) != FromProto(edge.to()), "pose_graph_edge.to", "must be another node than from");
  const bool is_one_agent = edge.from().agent_id() == edge.to().agent_id();
  switch (edge.measurement_case()) {
    case proto::PoseGraphEdge::kRelativePose:
      if (edge.source().empty()) {
        check.Require(
            is_one_agent, "pose_graph_edge.to.agent_id",
            "must be the agent of from, since odometry joins nodes of one agent; for a loop closure, set the source");
      } else {
        CheckSource(edge.source(), "pose_graph_edge.source", check);
      }
      return CheckRelativePose(edge.relative_pose(), "pose_graph_edge.relative_pose", check);
    case proto::PoseGraphEdge::kRange:
      check.Require(edge.source().empty(), "pose_graph_edge.source", "must be empty for a range");
      check.Require(!is_one_agent, "pose_graph_edge.to.agent_id",
                    "must be another agent than that of from: a range joins two agents");
      return CheckRange(edge.range(), check);
    case proto::PoseGraphEdge::MEASUREMENT_NOT_SET:
      check.Require(false, "pose_graph_edge.measurement", "is missing");
  }
}

void CheckPrior(const Record& record, FieldChecker& check) {
  const proto::PosePrior& prior = record.pose_prior();
  check.Node(prior.node(), "pose_prior.node");
  CheckSource(prior.source(), "pose_prior.source", check);
  check.Position(prior.point_m(), "pose_prior.point_m");
  switch (prior.measurement_case()) {
    case proto::PosePrior::kPositionM:
      check.Position(prior.position_m(), "pose_prior.position_m");
      return CheckCovariance(prior.covariance(), 3, "pose_prior.covariance", check);
    case proto::PosePrior::kPositionYaw:
      check.Position(prior.position_yaw().position_m(), "pose_prior.position_yaw.position_m");
      check.Finite(prior.position_yaw().yaw_rad(), "pose_prior.position_yaw.yaw_rad");
      return CheckCovariance(prior.covariance(), 4, "pose_prior.covariance", check);
    case proto::PosePrior::kPose:
      check.Pose(prior.pose(), "pose_prior.pose");
      check.Require(!prior.has_point_m(), "pose_prior.point_m", "must be absent for a pose");
      return CheckCovariance(prior.covariance(), 6, "pose_prior.covariance", check);
    case proto::PosePrior::MEASUREMENT_NOT_SET:
      check.Require(false, "pose_prior.measurement", "must be one of position_m, position_yaw and pose");
  }
}

void CheckVerdict(const Record& record, FieldChecker& check) {
  const proto::EdgeVerdict& verdict = record.edge_verdict();
  check.Node(verdict.from(), "edge_verdict.from");
  check.Node(verdict.to(), "edge_verdict.to");
  check.Finite(verdict.residual_sigmas(), "edge_verdict.residual_sigmas");
  check.Size(verdict.source(), kSourceBytesMax, "edge_verdict.source");
  check.Require(!verdict.is_range() || !verdict.is_prior(), "edge_verdict.is_prior",
                "cannot be combined with is_range");
  check.Term(verdict.term(), "edge_verdict.term");
}

// Requires the key of a map of the node.
void CheckMatchedMap(const proto::RecordKey& map, const proto::NodeKey& node, const std::string& field,
                     FieldChecker& check) {
  check.Require(map.data_type() == proto::LOCAL_TRAVERSABILITY_MAP, field + ".data_type",
                "must be local_traversability_map");
  check.Require(map.origin_agent() == node.agent_id(), field + ".origin_agent", "must be the agent of the node");
  CheckSharedKey(map, field, check);
}

void CheckMatch(const Record& record, FieldChecker& check) {
  const proto::MapMatch& match = record.map_match();
  check.Node(match.from(), "map_match.from");
  check.Node(match.to(), "map_match.to");
  check.Require(FromProto(match.from()) != FromProto(match.to()), "map_match.to", "must be another node than from");
  CheckRelativePose(match.relative_pose(), "map_match.relative_pose", check);
  const proto::Vector3& position_m = match.relative_pose().from_from_to().position_m();
  const double distance_m = std::hypot(position_m.x(), position_m.y(), position_m.z());
  check.Require(distance_m <= kMapMatchDistanceMax_m, "map_match.relative_pose.from_from_to.position_m",
                "must be at most 1000 m long");
  CheckMatchedMap(match.from_map(), match.from(), "map_match.from_map", check);
  CheckMatchedMap(match.to_map(), match.to(), "map_match.to_map", check);
  check.Ratio(match.overlap(), "map_match.overlap");
  check.Ratio(match.matched(), "map_match.matched");
  check.Ratio(match.second_best(), "map_match.second_best");
  check.Term(match.term(), "map_match.term");
}

void CheckQuarantinedFactor(const proto::QuarantinedFactor& factor, AgentId agent, FieldChecker& check) {
  check.Node(factor.from(), "map_quarantine.factor.from");
  check.Node(factor.to(), "map_quarantine.factor.to");
  check.Require(factor.from().agent_id() == agent || factor.to().agent_id() == agent, "map_quarantine.factor",
                "must join a node of map_quarantine.agent_id");
  check.Require(!factor.is_range() || !factor.is_prior(), "map_quarantine.factor.is_prior",
                "cannot be combined with is_range");
  check.Size(factor.source(), kSourceBytesMax, "map_quarantine.factor.source");
}

void CheckQuarantine(const Record& record, FieldChecker& check) {
  const proto::MapQuarantine& quarantine = record.map_quarantine();
  check.Text(quarantine.reason(), kQuarantineReasonBytesMax, "map_quarantine.reason");
  check.Size(quarantine.signature(), kSignatureBytes, "map_quarantine.signature");
  if (quarantine.has_lifts()) {
    const proto::RecordKey& lifted = quarantine.lifts();
    check.Agent(lifted.origin_agent(), "map_quarantine.lifts.origin_agent");
    check.Require(lifted.data_type() == proto::MAP_QUARANTINE, "map_quarantine.lifts.data_type",
                  "must be map_quarantine");
    return CheckSharedKey(lifted, "map_quarantine.lifts", check);
  }
  check.Agent(quarantine.agent_id(), "map_quarantine.agent_id");
  check.Require(quarantine.from_ns() <= quarantine.to_ns(), "map_quarantine.to_ns", "must not be before from_ns");
  if (quarantine.has_node()) {
    check.Require(quarantine.node().agent_id() == quarantine.agent_id(), "map_quarantine.node.agent_id",
                  "must equal map_quarantine.agent_id");
  }
  if (quarantine.has_factor()) CheckQuarantinedFactor(quarantine.factor(), quarantine.agent_id(), check);
  check.Size(quarantine.producer().source(), kSourceBytesMax, "map_quarantine.producer.source");
}

void CheckAssignment(const Record& record, FieldChecker& check) {
  const proto::RoleAssignment& roles = record.role_assignment();
  check.Term(roles.term(), "role_assignment.term");
  check.Agent(roles.term().issuer(), "role_assignment.term.issuer");
  check.Agent(roles.leader(), "role_assignment.leader");
  if (roles.survivor() != 0) check.Agent(roles.survivor(), "role_assignment.survivor");
  check.Require(roles.leader() != roles.survivor(), "role_assignment.survivor", "must not be the leader");
  check.Text(roles.reason(), kRoleReasonBytesMax, "role_assignment.reason");
  check.Size(roles.follows(), kSignatureBytes, "role_assignment.follows");
  check.Size(roles.signature(), kSignatureBytes, "role_assignment.signature");
}

std::vector<NamedAgent> EndsOf(const proto::NodeKey& from, const proto::NodeKey& to, const std::string& field) {
  return {{from.agent_id(), field + ".from.agent_id"}, {to.agent_id(), field + ".to.agent_id"}};
}

std::string NodeText(const proto::NodeKey& node) {
  return std::to_string(node.agent_id()) + ":" + std::to_string(node.index());
}

std::string EndsText(const proto::NodeKey& from, const proto::NodeKey& to) {
  return NodeText(from) + " " + NodeText(to);
}

std::string EdgeText(const proto::NodeKey& from, const proto::NodeKey& to, bool is_range, const std::string& source) {
  const std::string ends = EndsText(from, to);
  if (is_range) return "range " + ends;
  return source.empty() ? "odometry " + ends : "loop closure " + ends + " " + source;
}

std::string PriorText(const proto::NodeKey& node, const std::string& source) {
  return "prior " + NodeText(node) + " " + source;
}

constexpr std::array kRows = std::to_array<DataTypeRow>({
    {.type = proto::TEMPERATURE,
     .check = [](const Record& record,
                 FieldChecker& check) { check.Finite(record.temperature().celsius(), "temperature.celsius"); }},

    {.type = proto::POWER,
     .check =
         [](const Record& record, FieldChecker& check) {
           const double ratio = record.power().battery_ratio();
           check.Require(ratio >= 0 && ratio <= 1, "power.battery_ratio",
                         "must lie between 0 and 1; leave it out if the charge is unknown");
           check.Finite(record.power().draw_w(), "power.draw_w");
         }},

    {.type = proto::AWAKE_STATUS, .check = [](const Record&, FieldChecker&) {}},

    {.type = proto::MODE,
     .check =
         [](const Record& record, FieldChecker& check) {
           check.Require(proto::Activity_IsValid(record.mode().activity()), "mode.activity", "is unknown");
         }},

    {.type = proto::HEALTH,
     .check =
         [](const Record& record, FieldChecker& check) {
           check.Require(proto::HealthLevel_IsValid(record.health().level()), "health.level", "is unknown");
           check.Size(record.health().text(), kHealthTextBytesMax, "health.text");
         }},

    {.type = proto::EXPLORATION,
     .check =
         [](const Record& record, FieldChecker& check) {
           check.Ratio(record.exploration().explored_ratio(), "exploration.explored_ratio");
         }},

    {.type = proto::DISTRIBUTED_MEASUREMENTS,
     .check =
         [](const Record& record, FieldChecker& check) {
           check.Ratio(record.distributed_measurements().completed_ratio(), "distributed_measurements.completed_ratio");
         }},

    {.type = proto::POSE_GRAPH_NODE,
     .rank = ShareRank::kNodes,
     .share = proto::POLICY_ALL,
     .ground = proto::POLICY_ALL,
     .is_kept_unless_named = true,
     .is_news_for_solve = true,
     .is_news_for_matching = true,
     .check =
         [](const Record& record, FieldChecker& check) {
           check.Node(record.pose_graph_node().node(), "pose_graph_node.node");
           check.Pose(record.pose_graph_node().map_from_node(), "pose_graph_node.map_from_node");
         },
     .agents =
         [](const Record& record) {
           return std::vector<NamedAgent>{
               {record.pose_graph_node().node().agent_id(), "pose_graph_node.node.agent_id"}};
         },
     .speaker = Speaker::kNamedAgent,
     .natural_key = [](const Record& record) { return NodeText(record.pose_graph_node().node()); }},

    {.type = proto::POSE_GRAPH_EDGE,
     .rank = ShareRank::kEdges,
     .share = proto::POLICY_ALL,
     .ground = proto::POLICY_NONE,
     .is_kept_unless_named = true,
     .is_news_for_solve = true,
     .is_news_for_matching = true,
     .check = CheckEdge,
     .agents =
         [](const Record& record) {
           return EndsOf(record.pose_graph_edge().from(), record.pose_graph_edge().to(), "pose_graph_edge");
         },
     .speaker = Speaker::kNamedAgent,
     .natural_key =
         [](const Record& record) {
           const proto::PoseGraphEdge& edge = record.pose_graph_edge();
           return EdgeText(edge.from(), edge.to(), edge.has_range(), edge.source());
         }},

    {.type = proto::OPTIMIZED_POSE,
     .rank = ShareRank::kDerived,
     .is_kept_unless_named = true,
     .leader_sends = LeaderSends::kToAgentNamed,
     .check =
         [](const Record& record, FieldChecker& check) {
           check.Node(record.optimized_pose().node(), "optimized_pose.node");
           check.Pose(record.optimized_pose().map_from_node(), "optimized_pose.map_from_node");
           check.Term(record.optimized_pose().term(), "optimized_pose.term");
         },
     .agents =
         [](const Record& record) {
           return std::vector<NamedAgent>{{record.optimized_pose().node().agent_id(), "optimized_pose.node.agent_id"}};
         },
     .speaker = Speaker::kLeader,
     .term = [](const Record& record) -> const proto::Term& { return record.optimized_pose().term(); },
     .latest_key = [](const Record& record) { return NodeText(record.optimized_pose().node()); },
     .version =
         [](const Record& record) {
           return RecordVersion{OrderOf(record.optimized_pose().term()), record.optimized_pose().run()};
         }},

    {.type = proto::EDGE_VERDICT,
     .rank = ShareRank::kDerived,
     .ground = proto::POLICY_NONE,
     .is_kept_unless_named = true,
     .leader_sends = LeaderSends::kToAgentNamed,
     .check = CheckVerdict,
     .agents =
         [](const Record& record) {
           return EndsOf(record.edge_verdict().from(), record.edge_verdict().to(), "edge_verdict");
         },
     .speaker = Speaker::kLeader,
     .term = [](const Record& record) -> const proto::Term& { return record.edge_verdict().term(); },
     .latest_key =
         [](const Record& record) {
           const proto::EdgeVerdict& verdict = record.edge_verdict();
           if (verdict.is_prior()) return PriorText(verdict.from(), verdict.source());
           return EdgeText(verdict.from(), verdict.to(), verdict.is_range(), verdict.source());
         },
     .version =
         [](const Record& record) {
           return RecordVersion{OrderOf(record.edge_verdict().term()), record.edge_verdict().run()};
         }},

    {.type = proto::POSE_PRIOR,
     .rank = ShareRank::kEdges,
     .share = proto::POLICY_ALL,
     .ground = proto::POLICY_NONE,
     .is_kept_unless_named = true,
     .is_news_for_solve = true,
     .is_news_for_matching = true,
     .check = CheckPrior,
     .agents =
         [](const Record& record) {
           return std::vector<NamedAgent>{{record.pose_prior().node().agent_id(), "pose_prior.node.agent_id"}};
         },
     .speaker = Speaker::kNamedAgentOrCommander,
     .natural_key =
         [](const Record& record) { return PriorText(record.pose_prior().node(), record.pose_prior().source()); }},

    {.type = proto::MAP_MATCH,
     .rank = ShareRank::kDerived,
     .ground = proto::POLICY_NONE,
     .is_kept_unless_named = true,
     .is_news_for_solve = true,
     .check = CheckMatch,
     .agents =
         [](const Record& record) { return EndsOf(record.map_match().from(), record.map_match().to(), "map_match"); },
     .speaker = Speaker::kLeader,
     .term = [](const Record& record) -> const proto::Term& { return record.map_match().term(); },
     .latest_key = [](const Record& record) { return EndsText(record.map_match().from(), record.map_match().to()); },
     .version =
         [](const Record& record) {
           return RecordVersion{OrderOf(record.map_match().term()), record.map_match().run()};
         }},

    {.type = proto::LOCAL_TRAVERSABILITY_MAP,
     .rank = ShareRank::kMaps,
     .share = proto::POLICY_ALL,
     .ground = proto::POLICY_NONE,
     .is_bulky = true,
     .is_news_for_matching = true,
     .check =
         [](const Record& record, FieldChecker& check) {
           const Result<TraversabilityMap> map = FromProto(record.local_traversability_map());
           if (!map) check.Stop(map.error(), "local_traversability_map");
         },
     .agents =
         [](const Record& record) {
           return std::vector<NamedAgent>{
               {record.local_traversability_map().node().agent_id(), "local_traversability_map.node.agent_id"}};
         },
     .speaker = Speaker::kNamedAgent},

    {.type = proto::MAP_QUARANTINE,
     .rank = ShareRank::kDerived,
     .share = proto::POLICY_ALL,
     .ground = proto::POLICY_ALL,
     .may_be_latest = false,  // A newer quarantine does not supersede an older one.
     .is_kept_unless_named = true,
     .leader_sends = LeaderSends::kToAllRovers,
     .is_news_for_solve = true,
     .is_news_for_matching = true,
     .check = CheckQuarantine,
     .agents =
         [](const Record& record) {
           const proto::MapQuarantine& quarantine = record.map_quarantine();
           if (quarantine.has_lifts()) {
             return std::vector<NamedAgent>{{quarantine.lifts().origin_agent(), "map_quarantine.lifts.origin_agent"}};
           }
           return std::vector<NamedAgent>{{quarantine.agent_id(), "map_quarantine.agent_id"}};
         },
     .speaker = Speaker::kNamedAgentOrLeader,
     .term = [](const Record& record) -> const proto::Term& { return record.map_quarantine().term(); }},

    {.type = proto::AGENT_EVENT,
     .rank = ShareRank::kOthers,
     .share = proto::POLICY_ALL,
     .ground = proto::POLICY_ALL,
     .check =
         [](const Record& record, FieldChecker& check) {
           const proto::AgentEvent& event = record.agent_event();
           check.Require(event.kind() != proto::EVENT_KIND_UNSPECIFIED, "agent_event.kind", "is missing");
           check.Text(event.text(), kEventTextBytesMax, "agent_event.text");
           check.Text(event.by(), kEventByBytesMax, "agent_event.by");
         }},

    {.type = proto::ROLE_ASSIGNMENT,
     .rank = ShareRank::kRoles,
     .share = proto::POLICY_ALL,
     .ground = proto::POLICY_ALL,
     .may_be_latest = false,
     .is_kept_unless_named = true,
     .leader_sends = LeaderSends::kToAllRovers,
     .check = CheckAssignment,
     .agents =
         [](const Record& record) {
           const proto::RoleAssignment& roles = record.role_assignment();
           std::vector<NamedAgent> agents = {{roles.term().issuer(), "role_assignment.term.issuer"},
                                             {roles.leader(), "role_assignment.leader"}};
           if (roles.survivor() != 0) agents.push_back({roles.survivor(), "role_assignment.survivor"});
           return agents;
         }},
});

static_assert(std::ranges::is_sorted(kRows, {}, &DataTypeRow::type), "FindDataType searches them by number");
static_assert(std::ranges::none_of(kRows, [](const DataTypeRow& row) { return row.check == nullptr; }),
              "a data type without a check: one with nothing to check has an empty function");

}  // namespace

std::span<const DataTypeRow> DataTypeRows() { return kRows; }

const DataTypeRow* FindDataType(DataType type) {
  const auto found = std::ranges::lower_bound(kRows, type, {}, &DataTypeRow::type);
  return found == kRows.end() || found->type != type ? nullptr : &*found;
}

int SharingRank(DataType type) {
  if (type == proto::DATA_TYPE_UNSPECIFIED) return static_cast<int>(ShareRank::kStates);
  const DataTypeRow* row = FindDataType(type);
  return static_cast<int>(row == nullptr ? ShareRank::kOthers : row->rank);
}

bool IsDerived(DataType type) {
  const DataTypeRow* row = FindDataType(type);
  return row != nullptr && row->speaker == Speaker::kLeader;
}

bool IsBulky(DataType type) {
  const DataTypeRow* row = FindDataType(type);
  return row != nullptr && row->is_bulky;
}

bool IsState(DataType type) { return SharingRank(type) == static_cast<int>(ShareRank::kStates); }

}  // namespace moondb
