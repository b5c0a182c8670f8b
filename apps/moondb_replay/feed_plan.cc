#include "apps/moondb_replay/feed_plan.h"

#include <algorithm>

#include "actors/storage/clock_judge.h"
#include "model/data_types.h"
#include "model/record_check.h"

namespace moondb {
namespace {

proto::Record AwakeState(std::int64_t timestamp_ns) {
  proto::Record record;
  record.set_timestamp_ns(timestamp_ns);
  record.mutable_awake_status()->set_is_awake(true);
  return record;
}

proto::Record ModeState(std::int64_t timestamp_ns, bool is_base_station) {
  proto::Record record;
  record.set_timestamp_ns(timestamp_ns);
  record.mutable_mode()->set_activity(is_base_station ? proto::ACTIVITY_IDLE : proto::ACTIVITY_EXPLORING);
  return record;
}

void AddGraph(const Mission& mission, AgentId agent, const TimeSpan& span, std::vector<proto::Record>& records) {
  for (const GraphNode& node : mission.graph.nodes) {
    if (node.key.agent == agent && span.Contains(node.timestamp_ns)) records.push_back(ToRecord(node));
  }
  for (const OdometryEdge& edge : mission.graph.odometry) {
    if (edge.from.agent == agent && span.Contains(edge.timestamp_ns)) records.push_back(ToRecord(edge));
  }
  for (const RangeEdge& edge : mission.graph.ranges) {
    if (edge.from.agent == agent && span.Contains(edge.timestamp_ns)) records.push_back(ToRecord(edge));
  }
}

void AddStates(const Mission& mission, AgentId agent, std::vector<proto::Record>& records) {
  if (records.empty()) return;
  const auto earliest = std::min_element(
      records.begin(), records.end(), [](const auto& a, const auto& b) { return a.timestamp_ns() < b.timestamp_ns(); });
  const std::int64_t timestamp_ns = earliest->timestamp_ns();
  const bool is_base = std::any_of(mission.agents.begin(), mission.agents.end(), [agent](const MissionAgent& known) {
    return known.id == agent && known.is_base_station;
  });
  records.push_back(AwakeState(timestamp_ns));
  records.push_back(ModeState(timestamp_ns, is_base));
}

Result<void> AddMaps(const Mission& mission, AgentId agent, const TimeSpan& span, std::vector<proto::Record>& records) {
  for (const MissionMap& map : mission.maps) {
    if (map.agent != agent || !span.Contains(map.timestamp_ns)) continue;
    auto read = ReadMissionMap(mission, map);
    if (!read) return tl::unexpected(read.error());
    proto::Record& record = records.emplace_back();
    record.set_timestamp_ns(map.timestamp_ns);
    *record.mutable_local_traversability_map() = ToProto(*read);
  }
  return {};
}

// Returns what is added to the mission's timestamps: 0, or what moves the first one to kFeedStart_ns.
std::int64_t ShiftOf(const Mission& mission) {
  std::int64_t first_ns = INT64_MAX;
  for (const GraphNode& node : mission.graph.nodes) first_ns = std::min(first_ns, node.timestamp_ns);
  for (const MissionMap& map : mission.maps) first_ns = std::min(first_ns, map.timestamp_ns);
  return first_ns < kTimestampMin_ns ? kFeedStart_ns - first_ns : 0;
}

}  // namespace

Result<std::vector<proto::Record>> PlanFeed(const Mission& mission, AgentId agent, const TimeSpan& span) {
  std::vector<proto::Record> records;
  AddGraph(mission, agent, span, records);
  if (auto added = AddMaps(mission, agent, span, records); !added) return tl::unexpected(added.error());
  AddStates(mission, agent, records);
  const std::int64_t shift_ns = ShiftOf(mission);
  for (proto::Record& record : records) record.set_timestamp_ns(record.timestamp_ns() + shift_ns);
  std::stable_sort(records.begin(), records.end(), [](const proto::Record& a, const proto::Record& b) {
    return std::pair(a.timestamp_ns(), SharingRank(TypeOf(a))) < std::pair(b.timestamp_ns(), SharingRank(TypeOf(b)));
  });
  return records;
}

std::string FeedKey(const proto::Record& record) {
  return std::to_string(TypeOf(record)) + " " + std::to_string(record.timestamp_ns()) + " " + NaturalKey(record);
}

}  // namespace moondb
