// TeamRecording: what an agent holds about the team, in the order of time: poses, events and the merged map as it grew.
//
// All poses are the newest ones. The map at a time is that of the local maps measured until then, at these poses: the
// poses that were valid at that time are not kept. Rovers that are not placed are left out, with their maps. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "actors/merge/map_collection.h"
#include "client/client.h"
#include "model/timestamp_range.h"
#include "proto/team.pb.h"
#include "views/event_view.h"
#include "views/map_view.h"
#include "views/track_view.h"

namespace moondb {

class TeamRecording {
 public:
  // Reads the records from the agent that `client` is connected to. Returns the errors of Client::ReadAll, and kCorrupt
  // for a record whose content does not fit its type.
  static Result<TeamRecording> Read(Client& client, const proto::TeamConfig& team, const TimestampRange& times);

  // Called in the order of time. An error ends the replay.
  struct Sink {
    std::function<Result<void>(const PoseView&)> pose;
    std::function<Result<void>(const EventView&)> event;
    std::function<Result<void>(const MapView&)> map;
  };
  // Replays the recording. The map is reported when a cell has changed, at most about a hundred times and at most every
  // 5 s. Returns the errors of the sink, and those of Merger::Merge.
  Result<void> Replay(const Sink& sink) const;

  std::size_t map_count() const { return selected_.maps.size(); }
  // Rovers that are not placed, with the number of their maps.
  const std::map<AgentId, std::size_t>& unplaced() const { return selected_.unplaced; }
  // Number of poses and events left out because their robot's clock was not trusted or a time is outside 1970 to 2038.
  std::size_t without_time_count() const { return without_time_count_; }

 private:
  struct Instant;

  TeamRecording(const proto::TeamConfig& team, const TimestampRange& times)
      : times_(times), options_(MapCollection::OptionsOf(team, /*self=*/0)) {}

  void TakePoses(const MapCollection& collection);
  std::vector<Instant> Timeline() const;

  // A node's timestamp, and whether the clock of its robot was trusted.
  struct NodeTime {
    std::int64_t ns = 0;
    bool is_trusted = false;
  };

  const TimestampRange times_;
  const MapCollection::Options options_;
  std::map<NodeKey, NodeTime> node_times_;
  MapCollection::Selected selected_;  // Maps and footprints by their times.
  std::vector<PoseView> poses_;
  std::vector<EventView> events_;
  std::size_t without_time_count_ = 0;
};

}  // namespace moondb
