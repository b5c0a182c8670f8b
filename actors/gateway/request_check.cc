#include "actors/gateway/request_check.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "model/data_types.h"
#include "model/prune_rules.h"
#include "model/record_check.h"
#include "model/team_id.h"
#include "model/team_member.h"
#include "model/term.h"

namespace moondb {
namespace {

constexpr double kAbsoluteZero_celsius = -273.15;
constexpr double kQuaternionErrorMax = 0.01;

bool IsMember(const proto::TeamConfig& team, std::uint64_t id) {
  return std::any_of(team.agents().begin(), team.agents().end(),
                     [id](const proto::AgentConfig& agent) { return agent.id() == id; });
}

Result<void> CheckMember(const proto::TeamConfig& team, std::uint64_t id, const std::string& field) {
  if (IsMember(team, id)) return {};
  return Fail(ErrorCode::kInvalid, "agent " + std::to_string(id) + " is not in team " + team.team(), field);
}

template <typename List>
Result<void> CheckMembers(const proto::TeamConfig& team, const List& agents, const std::string& field) {
  if (agents.size() > kFilterEntriesMax) return Fail(ErrorCode::kInvalid, "too many agents", field);
  for (int i = 0; i < agents.size(); ++i) {
    auto checked = CheckMember(team, agents[i], field + "[" + std::to_string(i) + "]");
    if (!checked) return checked;
  }
  return {};
}

Result<void> CheckAgentsOfRecord(const proto::TeamConfig& team, const proto::Record& record, const std::string& at) {
  for (const NamedAgent& named : AgentsNamedIn(record)) {
    if (auto checked = CheckMember(team, named.agent, at + "." + named.field); !checked) return checked;
  }
  return {};
}

// Checks a term that a client sends. Accepts issuer 0, which is the issuer of the team file's initial term.
Result<void> CheckTerm(const proto::TeamConfig& team, const proto::Term& term, const std::string& field) {
  if (term.number() > kTermNumberMax) {
    return Fail(ErrorCode::kInvalid, "is above " + std::to_string(kTermNumberMax), field + ".number");
  }
  if (term.issuer() == 0) return {};
  return CheckMember(team, term.issuer(), field + ".issuer");
}

Result<void> CheckKind(proto::SharingKind kind, const std::string& field) {
  if (kind == proto::SHARING_KIND_SYNC || kind == proto::SHARING_KIND_REPLICATION) return {};
  return Fail(ErrorCode::kInvalid, "must be sync or replication", field);
}

Result<void> CheckWait(double wait_s, double max_s, const std::string& field) {
  if (wait_s >= 0 && wait_s <= max_s) return {};
  return Fail(ErrorCode::kInvalid, "must lie between 0 and " + std::to_string(static_cast<int>(max_s)) + " s", field);
}

Result<void> CheckExpectedRoles(const proto::TeamConfig& team, const proto::RoleAssignment& roles) {
  if (auto checked = CheckTerm(team, roles.term(), "role_set.expected.term"); !checked) return checked;
  if (roles.leader() != 0) {
    if (auto checked = CheckMember(team, roles.leader(), "role_set.expected.leader"); !checked) return checked;
  }
  if (roles.survivor() == 0) return {};
  return CheckMember(team, roles.survivor(), "role_set.expected.survivor");
}

Result<void> CheckCoordinate(double metres, const std::string& field) {
  if (std::abs(metres) <= kMapCoordinateMax_m) return {};  // The comparison is false for NaN.
  return Fail(ErrorCode::kInvalid, "must lie between -1e9 and 1e9 m", field);
}

// Catches programming errors of clients, such as a rotation that is not normalised. CheckRecord catches missing
// numbers.
Result<void> CheckPose(const proto::Pose& pose, const std::string& field) {
  const proto::Quaternion& q = pose.orientation();
  const double norm = std::hypot(std::hypot(q.x(), q.y()), std::hypot(q.z(), q.w()));
  if (pose.has_orientation() && !(std::abs(norm - 1) <= kQuaternionErrorMax)) {
    return Fail(ErrorCode::kInvalid, "must be a quaternion of length 1 (tolerance 1 %)", field + ".orientation");
  }
  for (const double metres : {pose.position_m().x(), pose.position_m().y(), pose.position_m().z()}) {
    if (auto checked = CheckCoordinate(metres, field + ".position_m"); !checked) return checked;
  }
  return {};
}

// Refuses numbers that no robot measures. Applies only to records that clients insert, not to records of peers.
Result<void> CheckPhysics(const proto::Record& record, const std::string& at) {
  switch (record.body_case()) {
    case proto::Record::kTemperature:
      if (record.temperature().celsius() >= kAbsoluteZero_celsius) return {};  // The comparison is false for NaN.
      return Fail(ErrorCode::kInvalid, "lies below absolute zero", at + ".temperature.celsius");
    case proto::Record::kPoseGraphNode:
      return CheckPose(record.pose_graph_node().map_from_node(), at + ".pose_graph_node.map_from_node");
    case proto::Record::kPoseGraphEdge:
      if (!record.pose_graph_edge().has_relative_pose()) return {};
      return CheckPose(record.pose_graph_edge().relative_pose().from_from_to(),
                       at + ".pose_graph_edge.relative_pose.from_from_to");
    case proto::Record::kPosePrior:
      if (!record.pose_prior().has_pose()) return {};
      return CheckPose(record.pose_prior().pose(), at + ".pose_prior.pose");
    case proto::Record::kLocalTraversabilityMap:
      return CheckPose(record.local_traversability_map().node_from_map(),
                       at + ".local_traversability_map.node_from_map");
    default:
      return {};
  }
}

}  // namespace

Result<void> CheckInsert(const proto::TeamConfig& team, const proto::InsertRequest& insert) {
  if (insert.records().empty()) return Fail(ErrorCode::kInvalid, "no record to insert", "insert.records");
  if (insert.records_size() > kClientInsertRecordsMax) {
    return Fail(ErrorCode::kInvalid, "at most " + std::to_string(kClientInsertRecordsMax) + " records at a time",
                "insert.records");
  }
  for (int i = 0; i < insert.records_size(); ++i) {
    const std::string at = "insert.records[" + std::to_string(i) + "]";
    if (insert.records(i).has_agent_event()) {
      return Fail(ErrorCode::kInvalid, "cannot be inserted: agents write their events themselves", at + ".agent_event");
    }
    if (insert.records(i).has_role_assignment()) {
      return Fail(ErrorCode::kInvalid,
                  "cannot be inserted: agents write role assignments themselves; change roles with `role set`",
                  at + ".role_assignment");
    }
    const DataTypeRow* row = FindDataType(TypeOf(insert.records(i)));
    if (row != nullptr && row->speaker == Speaker::kLeader) {
      return Fail(ErrorCode::kInvalid, "cannot be inserted: the leader computes it; insert nodes, edges and maps",
                  at + "." + DataTypeName(row->type));
    }
    if (auto checked = CheckAgentsOfRecord(team, insert.records(i), at); !checked) return checked;
    if (auto checked = CheckPhysics(insert.records(i), at); !checked) return checked;
  }
  return {};
}

Result<void> CheckRead(const proto::ReadRequest& read) {
  if (read.data_types_size() > kFilterEntriesMax) {
    return Fail(ErrorCode::kInvalid, "has more than " + std::to_string(kFilterEntriesMax) + " data types",
                "read.data_types");
  }
  if (read.origin_agents_size() > kFilterEntriesMax) {
    return Fail(ErrorCode::kInvalid, "has more than " + std::to_string(kFilterEntriesMax) + " agents",
                "read.origin_agents");
  }
  if (auto checked = CheckWait(read.wait_s(), kReadWaitMax_s, "read.wait_s"); !checked) return checked;
  if (read.wait_s() > 0 && read.is_newest_first()) {
    return Fail(ErrorCode::kInvalid, "cannot be combined with is_newest_first", "read.wait_s");
  }
  if (read.wait_s() > 0 && read.is_history()) {
    return Fail(ErrorCode::kInvalid, "cannot be combined with is_history", "read.wait_s");
  }
  const bool has_from = read.from_presence_case() != proto::ReadRequest::FROM_PRESENCE_NOT_SET;
  const bool has_to = read.to_presence_case() != proto::ReadRequest::TO_PRESENCE_NOT_SET;
  if (has_from && has_to && read.from_ns() > read.to_ns()) {
    return Fail(ErrorCode::kInvalid, "is later than to_ns", "read.from_ns");
  }
  if (read.keys().empty()) return {};
  if (read.keys_size() > kFilterEntriesMax) {
    return Fail(ErrorCode::kInvalid, "has more than " + std::to_string(kFilterEntriesMax) + " entries", "read.keys");
  }
  if (!read.data_types().empty() || !read.origin_agents().empty() || has_from || has_to || read.is_newest_first() ||
      read.wait_s() > 0 || read.is_history()) {
    return Fail(ErrorCode::kInvalid, "can be combined only with after_row_id, records_max and content_bytes_max",
                "read.keys");
  }
  return {};
}

Result<void> CheckRoleSet(const proto::TeamConfig& team, const proto::RoleSetRequest& set) {
  if (!set.is_swap() && set.leader() == 0 && set.survivor() == 0) {
    return Fail(ErrorCode::kInvalid, "names neither a leader nor a designated survivor", "role_set");
  }
  if (set.reason().size() > kRoleReasonBytesMax) {
    return Fail(ErrorCode::kInvalid, "is longer than " + std::to_string(kRoleReasonBytesMax) + " bytes",
                "role_set.reason");
  }
  if (auto checked = CheckWait(set.wait_s(), kOrderWaitMax_s, "role_set.wait_s"); !checked) return checked;
  if (set.has_expected()) {
    if (auto checked = CheckExpectedRoles(team, set.expected()); !checked) return checked;
  }
  if (set.leader() != 0) {
    if (auto checked = CheckMember(team, set.leader(), "role_set.leader"); !checked) return checked;
  }
  if (set.survivor() != 0) return CheckMember(team, set.survivor(), "role_set.survivor");
  return {};
}

Result<void> CheckShare(const proto::TeamConfig& team, AgentId self, const proto::ShareRequest& share) {
  if (auto checked = CheckKind(share.kind(), "share.kind"); !checked) return checked;
  if (share.destination() != 0) {
    if (auto checked = CheckMember(team, share.destination(), "share.destination"); !checked) return checked;
    if (share.destination() == self) {
      return Fail(ErrorCode::kInvalid, "is this agent itself; name another agent", "share.destination");
    }
  }
  if (auto checked = CheckTerm(team, share.expected_term(), "share.expected_term"); !checked) return checked;
  if (share.order() != 0) return Fail(ErrorCode::kInvalid, "must be 0: agents number orders", "share.order");
  if (auto checked = CheckWait(share.wait_s(), kOrderWaitMax_s, "share.wait_s"); !checked) return checked;
  return CheckMembers(team, share.from_agents(), "share.from_agents");
}

Result<void> CheckShareProgress(const proto::ShareProgressRequest& progress) {
  if (auto checked = CheckKind(progress.kind(), "share_progress.kind"); !checked) return checked;
  return CheckWait(progress.wait_s(), kReadWaitMax_s, "share_progress.wait_s");
}

Result<void> CheckRegistration(const proto::RegistrationRequest& registration) {
  return CheckWait(registration.wait_s(), kRegistrationWaitMax_s, "registration.wait_s");
}

Result<void> CheckOptimize(const proto::TeamConfig& team, const proto::OptimizeRequest& optimize) {
  if (optimize.from_scratch() && optimize.window_nodes() > 0) {
    return Fail(ErrorCode::kInvalid, "cannot be combined with from_scratch: a window continues the last solution",
                "optimize.window_nodes");
  }
  if (optimize.covariance_of_size() > kCovariancesMax) {
    return Fail(ErrorCode::kInvalid, "at most " + std::to_string(kCovariancesMax) + " nodes at a time",
                "optimize.covariance_of");
  }
  for (int i = 0; i < optimize.covariance_of_size(); ++i) {
    const std::string field = "optimize.covariance_of[" + std::to_string(i) + "].agent_id";
    if (auto checked = CheckMember(team, optimize.covariance_of(i).agent_id(), field); !checked) return checked;
  }
  return {};
}

Result<void> CheckPrune(const proto::PruneOrder& prune) {
  if (!(prune.older_than_s() >= 0 && prune.older_than_s() <= kPruneAgeMax_s)) {
    return Fail(ErrorCode::kInvalid, "must lie between 0 and 1e9 s", "prune.older_than_s");
  }
  if (!(prune.content_bytes_max() >= 0 && std::isfinite(prune.content_bytes_max()))) {
    return Fail(ErrorCode::kInvalid, "must not be negative", "prune.content_bytes_max");
  }
  if (prune.data_types_size() > kFilterEntriesMax) {
    return Fail(ErrorCode::kInvalid, "too many data types", "prune.data_types");
  }
  if (prune.occluded_maps() && !prune.data_types().empty()) {
    return Fail(ErrorCode::kInvalid, "must be empty if occluded_maps is set, because that removes only maps",
                "prune.data_types");
  }
  if (prune.occluded_maps() && prune.is_history()) {
    return Fail(ErrorCode::kInvalid, "cannot be combined with occluded_maps: maps have no history", "prune.is_history");
  }
  return {};
}

Result<void> CheckMapTiles(const proto::MapTilesRequest& tiles) {
  if (auto checked = CheckWait(tiles.wait_s(), kMapWaitMax_s, "map_tiles.wait_s"); !checked) return checked;
  if (std::abs(static_cast<double>(tiles.after().x())) > kMapTileMax ||
      std::abs(static_cast<double>(tiles.after().y())) > kMapTileMax) {
    return Fail(ErrorCode::kInvalid, "is outside the range of tile numbers", "map_tiles.after");
  }
  if (!tiles.has_region()) return {};
  const proto::MapRegion& region = tiles.region();
  if (auto checked = CheckCoordinate(region.x_min_m(), "map_tiles.region.x_min_m"); !checked) return checked;
  if (auto checked = CheckCoordinate(region.y_min_m(), "map_tiles.region.y_min_m"); !checked) return checked;
  if (auto checked = CheckCoordinate(region.x_max_m(), "map_tiles.region.x_max_m"); !checked) return checked;
  if (auto checked = CheckCoordinate(region.y_max_m(), "map_tiles.region.y_max_m"); !checked) return checked;
  if (region.x_min_m() <= region.x_max_m() && region.y_min_m() <= region.y_max_m()) return {};
  return Fail(ErrorCode::kInvalid, "has a minimum above its maximum", "map_tiles.region");
}

Result<void> CheckMerge(const proto::TeamConfig& team, const proto::MergeRequest& merge) {
  return CheckMembers(team, merge.agents(), "merge.agents");
}

Result<void> CheckMapWhy(const proto::MapWhyRequest& why) {
  if (auto checked = CheckCoordinate(why.x_m(), "map_why.x_m"); !checked) return checked;
  return CheckCoordinate(why.y_m(), "map_why.y_m");
}

Result<void> CheckAcknowledge(const proto::AcknowledgeRequest& acknowledge) {
  if (acknowledge.until_ns() >= 0) return {};
  return Fail(ErrorCode::kInvalid, "must be the timestamp of a finding, or 0", "acknowledge.until_ns");
}

Result<void> CheckForAgent(const proto::TeamConfig& team, const proto::ControlRequest& request) {
  if (request.for_agent() == 0) return {};
  if (auto checked = CheckMember(team, request.for_agent(), "for_agent"); !checked) return checked;
  if (!HasLeft(team, request.for_agent())) return {};
  return Fail(ErrorCode::kRefused, "agent " + std::to_string(request.for_agent()) + " has left the team", "for_agent");
}

Result<void> CheckTeamOf(const proto::ControlRequest& request, const proto::TeamConfig& team) {
  if (request.team_id().empty()) return {};
  if (request.team_id().size() != kTeamIdBytes) {
    return Fail(ErrorCode::kInvalid, "must have 16 bytes or be empty", "team_id");
  }
  const std::string own = TeamIdBytes(team.team_id());
  if (request.team_id() == own) return {};
  return Fail(ErrorCode::kRefused, "this agent belongs to another team: " + team.team() + " with the team id " +
                                       TeamIdStart(own) + "; the request is for the team id " +
                                       TeamIdStart(request.team_id()));
}

void BoundPage(proto::ReadRequest& request, bool is_relayed) {
  const std::uint32_t content_bytes_max = is_relayed ? kRelayedContentBytesMax : kReadContentBytesMax;
  if (request.records_max() == 0) request.set_records_max(kReadRecordsDefault);
  request.set_records_max(std::min(request.records_max(), kReadRecordsMax));
  if (request.content_bytes_max() == 0) request.set_content_bytes_max(kReadContentBytesDefault);
  request.set_content_bytes_max(std::min(request.content_bytes_max(), content_bytes_max));
}

}  // namespace moondb
