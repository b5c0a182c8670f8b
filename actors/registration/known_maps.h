// KnownMaps: the local maps, node poses, odometry, quarantines and map matches of an agent, as far as registration
// needs them.
//
// The registered maps are those that can be matched: their node has an optimized pose, and no quarantine leaves them
// out. The result depends only on the set of added records, not on their order, with the exception of NodePoses. Maps
// are held packed, without layers coarser than HazardField uses. If maps exceed their limits, the agents with the most
// records keep only their newest maps. Single-threaded.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "actors/registration/hazard_field.h"
#include "actors/registration/known_tracks.h"
#include "actors/registration/match_candidates.h"
#include "model/error.h"
#include "model/node_poses.h"
#include "model/origin_quota.h"
#include "model/quarantine_set.h"
#include "model/term.h"
#include "proto/record.pb.h"

namespace moondb {

class KnownMaps {
 public:
  struct Options {
    std::size_t maps_max = 65535;
    std::uint64_t bytes_max = 256ull << 20;  // Maximum total size of the packed maps.
    std::size_t nodes_max = 200'000;
    std::size_t matches_max = 600'000;
    std::size_t quarantines_max = 65535;
    // Agents whose body may appear in the maps of others, and the radius of the disc that it may cover.
    std::set<AgentId> rovers;
    double body_radius_m = 0.75;
  };

  // A stored match between the nodes of two maps.
  struct Match {
    RecordKey key;
    proto::MapMatch body;
    LoopClosure closure;
  };

  explicit KnownMaps(Options options);

  // Adds a node, edge, optimized pose, local map, quarantine or map match; ignores other types. Call it once per
  // record. Fails as the conversion of the record does.
  Result<void> Add(const RecordKey& key, const proto::Record& record);

  // Returns the registered maps, sorted by record key. Adds to `unposed_count`, if it is given, the number of maps
  // whose node has no optimized pose, without quarantined maps.
  std::vector<RegisteredMap> FindRegistered(std::size_t* unposed_count = nullptr) const;
  // Returns the cells of a map; nullopt for an unknown map.
  std::optional<TraversabilityMap> FindMap(const RecordKey& key) const;
  // Returns discs around the other rovers at the time of the map, in the frame of the map. Their place is that of their
  // node that is nearest in time, at most 30 s away.
  // `in_frame`: the agents to look for, whose poses are in one frame with the map; null: all.
  std::vector<MaskedDisc> FindRovers(const RegisteredMap& map, const std::set<AgentId>* in_frame = nullptr) const;
  // Returns the odometry of a rover; null without nodes.
  std::shared_ptr<const RoverTrack> FindTrack(AgentId agent) const { return tracks_.FindTrack(agent); }
  // Returns the pairs of agents, the lower id first, whose nodes a match joins.
  std::set<std::pair<AgentId, AgentId>> FindMatched() const;
  // Returns the valid match between two nodes; null if there is none.
  const Match* FindMatch(const NodeKey& from, const NodeKey& to) const;
  // Returns the highest run among the matches of a term; 0 if there is none.
  std::uint64_t LastRun(const proto::Term& term) const;
  // Returns the number of valid matches between two nodes whose maps are not both held.
  std::size_t CountMatchesOfRemovedMaps() const;

  std::size_t map_count() const { return maps_.size(); }
  // Number of records dropped because a limit was reached, by origin.
  std::map<AgentId, std::uint64_t> CountLeftOut() const;

 private:
  using Order = decltype(OrderOf(proto::Term()));

  struct HeldMap {
    proto::LocalTraversabilityMap packed;
    NodeKey node;
    Pose node_from_map;
    std::int64_t timestamp_ns = 0;
    std::uint64_t bytes = 0;
  };

  Result<void> AddMap(const RecordKey& key, const proto::Record& record);
  Result<void> AddMatch(const RecordKey& key, const proto::Record& record);
  void RemoveMap(const RecordKey& key) { maps_.erase(key); }

  struct NoNote {};

  Options options_;
  std::map<RecordKey, HeldMap> maps_;
  OriginQuota<NoNote> map_quota_;
  OriginQuota<NoNote> bytes_quota_;
  NodePoses poses_;
  KnownTracks tracks_;
  std::map<AgentId, std::map<std::int64_t, NodeKey>> node_times_;  // Nodes of rovers by timestamp.
  std::size_t node_time_count_ = 0;
  QuarantineSet quarantines_;
  std::map<std::pair<NodeKey, NodeKey>, Match> matches_;
  std::map<AgentId, std::uint64_t> left_out_matches_;
  std::map<Order, std::uint64_t> last_runs_;
};

}  // namespace moondb
