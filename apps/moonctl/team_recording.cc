#include "apps/moonctl/team_recording.h"

#include <algorithm>
#include <chrono>
#include <span>
#include <utility>

#include "actors/merge/merger.h"
#include "apps/common/valid_records.h"
#include "apps/mcap/ros_messages.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr std::int64_t kReportPeriodMin_ns = 5'000'000'000;
constexpr std::int64_t kReportsMax = 100;
constexpr std::int64_t kReportedCellsMax = 16ll << 20;

bool IsInRosTime(std::int64_t timestamp_ns) { return timestamp_ns >= 0 && timestamp_ns <= kRosTimeMax_ns; }

proto::ReadRequest RequestOf(std::initializer_list<DataType> types) {
  proto::ReadRequest request;
  for (const DataType type : types) request.add_data_types(type);
  return request;
}

}  // namespace

// A moment of the replay. At equal times, poses and events come before the map.
struct TeamRecording::Instant {
  std::int64_t ns = 0;
  enum Kind { kPose, kEvent, kMap } kind = kMap;
  std::size_t index = 0;  // In poses_ or events_.

  auto operator<=>(const Instant&) const = default;
};

Result<TeamRecording> TeamRecording::Read(Client& client, const proto::TeamConfig& team, const TimestampRange& times) {
  TeamRecording recording(team, times);
  MapCollection collection(recording.options_);
  const auto take = [&](const RecordKey& key, const proto::Record& record) -> Result<void> {
    if (record.has_agent_event()) {
      const EventView event = EventViewOf(key, record);
      const bool has_time = !record.is_clock_suspect() && IsInRosTime(event.timestamp_ns);
      if (has_time) recording.events_.push_back(event);
      recording.without_time_count_ += has_time ? 0 : 1;
      return {};
    }
    if (record.has_pose_graph_node()) {
      recording.node_times_[FromProto(record.pose_graph_node().node())] = {record.timestamp_ns(),
                                                                           !record.is_clock_suspect()};
    }
    // A map that cannot be merged, for example because its cells are too fine, is left out, as in the team's map.
    const Result<void> added = collection.Add(key, record);
    if (!added && !record.has_local_traversability_map()) {
      return Fail(ErrorCode::kCorrupt, ToString(key) + ": " + added.error().text, added.error().field);
    }
    return {};
  };
  ValidRecords records(client, team);
  const auto mapped = RequestOf(
      {proto::POSE_GRAPH_NODE, proto::OPTIMIZED_POSE, proto::MAP_QUARANTINE, proto::LOCAL_TRAVERSABILITY_MAP});
  if (auto read = records.ReadAll(mapped, take); !read) return tl::unexpected(read.error());
  proto::ReadRequest events = RequestOf({proto::AGENT_EVENT});
  events.set_from_ns(times.from_ns);
  events.set_to_ns(times.to_ns);
  if (auto read = records.ReadAll(events, take); !read) return tl::unexpected(read.error());
  recording.selected_ = collection.Select({});
  recording.TakePoses(collection);
  return recording;
}

void TeamRecording::TakePoses(const MapCollection& collection) {
  const auto take = [&](const NodeKey& node, const NodeTime& time) {
    const ValidPose* pose = collection.PoseOf(node);
    if (pose == nullptr || !times_.Contains(time.ns)) return;
    if (!time.is_trusted || !IsInRosTime(time.ns)) {
      ++without_time_count_;
      return;
    }
    poses_.push_back({node, time.ns, pose->map_from_node, pose->source == PoseSource::kOptimized});
  };
  const auto time_of = [this](const Footprint& footprint) { return node_times_[footprint.node].ns; };
  for (const Footprint& footprint : selected_.footprints) take(footprint.node, node_times_[footprint.node]);
  for (const auto& [node, time] : node_times_) {
    if (options_.without_footprint.contains(node.agent)) take(node, time);
  }
  std::ranges::stable_sort(selected_.footprints, {}, time_of);
  std::ranges::stable_sort(selected_.maps, {}, [](const PlacedMap& placed) { return placed.map->timestamp_ns; });
}

std::vector<TeamRecording::Instant> TeamRecording::Timeline() const {
  std::vector<Instant> timeline;
  for (std::size_t i = 0; i < poses_.size(); ++i) timeline.push_back({poses_[i].timestamp_ns, Instant::kPose, i});
  for (std::size_t i = 0; i < events_.size(); ++i) timeline.push_back({events_[i].timestamp_ns, Instant::kEvent, i});
  // The map changes while robots drive, so events do not stretch its times.
  std::set<std::int64_t> times;
  for (const PoseView& pose : poses_) times.insert(pose.timestamp_ns);
  for (const PlacedMap& placed : selected_.maps) {
    const std::int64_t ns = placed.map->timestamp_ns;
    if (IsInRosTime(ns) && times_.Contains(ns)) times.insert(ns);
  }
  if (!times.empty()) {
    const std::int64_t first = *times.begin(), last = *times.rbegin();
    const std::int64_t period = std::max(kReportPeriodMin_ns, (last - first) / kReportsMax + 1);
    for (std::int64_t ns = first; ns < last; ns += period) timeline.push_back({ns, Instant::kMap, 0});
    timeline.push_back({last, Instant::kMap, 0});
  }
  std::ranges::sort(timeline);
  return timeline;
}

Result<void> TeamRecording::Replay(const Sink& sink) const {
  Result<std::unique_ptr<GatherBackend>> backend = CreateGatherBackend(MergeBackend::kCpu);
  if (!backend) return tl::unexpected(backend.error());
  Merger merger(options_.grid, std::move(*backend));
  const auto report_map = [&](std::int64_t ns) -> Result<void> {
    const auto maps = std::ranges::upper_bound(selected_.maps, ns, {},
                                               [](const PlacedMap& placed) { return placed.map->timestamp_ns; });
    const auto footprints = std::ranges::upper_bound(
        selected_.footprints, ns, {}, [this](const Footprint& footprint) { return node_times_.at(footprint.node).ns; });
    (void)merger.Assign(std::span(selected_.maps.begin(), maps), std::span(selected_.footprints.begin(), footprints));
    const Result<MergeSummary> merged = merger.Merge({});
    if (!merged) return tl::unexpected(merged.error());
    if (merged->changed_tiles == 0) return {};
    Result<MergedMap> map = merger.ReadCells(merger.CropTo(kReportedCellsMax).box);
    if (!map) return tl::unexpected(map.error());
    return sink.map({ns, CroppedToKnown(*map, /*margin_cells=*/0)});
  };
  for (const Instant& instant : Timeline()) {
    const Result<void> done = instant.kind == Instant::kPose    ? sink.pose(poses_[instant.index])
                              : instant.kind == Instant::kEvent ? sink.event(events_[instant.index])
                                                                : report_map(instant.ns);
    if (!done) return done;
  }
  return {};
}

}  // namespace moondb
