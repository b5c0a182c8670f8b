// MapCollection: the maps, node poses and quarantines of an agent, kept between merges. Select() returns a Merger's
// input.
//
// Select() depends only on the set of added records, not on their order. Each record must be added once. If records of
// a kind exceed their limit, the agents with the most records keep only their newest records (model/origin_quota.h),
// and CountLeftOut counts the dropped records. Requires: poses are within the bounds of model/geometry.h. Used by one
// thread at a time.
//
// Rovers that are not placed. A rover whose pose in the frame `map` is unknown has its maps and footprints left out;
// its maps wait: those at optimized poses that are unplaced or carried on from such a pose. Maps at raw poses wait if
// the rover has no configured start, or if the last solve did not place it. Two exceptions show such a
// rover's maps in its own frame, without other maps: a selection of the rover alone, and a selection without agents at
// the rover's own agent.
//
// A quarantine of an agent's maps leaves out the footprints of the agent's nodes too: those whose raw pose has a
// timestamp in its time range. A node without a raw pose has no known timestamp; only a quarantine without times leaves
// out its footprint.
//
// Memory: the default limits keep this class and the Merger's placed footprints at about 160 MB: 96 MiB for maps, and
// 1.5 kB for each node with its footprint. The Merger's pages take at most 160 MB more (kPagesMax).
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "actors/merge/placement.h"
#include "model/error.h"
#include "model/far_nodes.h"
#include "model/ids.h"
#include "model/node_poses.h"
#include "model/origin_quota.h"
#include "model/quarantine_set.h"
#include "model/record_key.h"
#include "model/traversability_map.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"

namespace moondb {

class MapCollection {
 public:
  struct Options {
    MergeGrid grid;
    std::set<AgentId> without_footprint;  // Agents without a footprint: base stations, which do not move.
    AgentId self = 0;                     // The agent that merges.
    // Rovers whose raw poses lie in the frame `map`, because their start is configured. Null: all. The place of a base
    // station is always known.
    std::optional<std::set<AgentId>> with_start = {};
    std::size_t maps_max = 65535;
    std::uint64_t bytes_max = 96ull << 20;  // Maximum total size of all maps.
    std::size_t nodes_max = 40'000;         // Maximum number of node records, and of nodes with an optimized pose.
    std::size_t quarantines_max = 65535;    // Maximum number of records that quarantine maps or lift a quarantine.
  };

  // Selects the input of one merge.
  struct Selection {
    bool use_raw_poses = false;  // If true, optimized poses are ignored.
    std::set<AgentId> agents;    // Uses only maps of these origins, and footprints of their nodes. Empty: all origins.

    bool is_everything() const { return !use_raw_poses && agents.empty(); }
  };

  // Odometry does not connect this node and the newer ones with the last optimized pose.
  struct Cut {
    std::uint64_t first_index = 0;
    std::size_t map_count = 0;  // Number of the maps that wait for this reason.
  };

  struct Selected {
    std::vector<PlacedMap> maps;        // Sorted by record key.
    std::vector<Footprint> footprints;  // Sorted by node.
    // Selected maps whose node is unknown or has no valid pose, or whose rover is not placed.
    std::vector<std::shared_ptr<const LocalMap>> waiting_maps;
    std::vector<std::shared_ptr<const LocalMap>> quarantined_maps;  // Selected maps that a quarantine leaves out.
    // Nodes that lie absurdly far from the others, the farthest first. Their maps and footprints are left out.
    std::vector<FarNode> far_nodes;
    // 0: all lies in the frame `map`. Otherwise all is of this rover, which is not placed, and lies in its own frame.
    AgentId frame_of = 0;
    // Selected rovers that have nodes and are not placed, with the number of their waiting maps. At frame_of's own
    // agent it is empty.
    std::map<AgentId, std::size_t> unplaced;
    // Selected rovers whose newer maps wait for the next solve (NodePoses::ValidPoses::cut_at).
    std::map<AgentId, Cut> cut;
  };

  // Timestamp assigned by the map's origin.
  struct Timestamp {
    std::int64_t ns = 0;
    bool is_clock_suspect = false;  // If true, a merge treats the map as older than all maps with a trusted timestamp.
  };

  struct Quarantine {
    RecordKey key;
    proto::MapQuarantine said;
    std::size_t map_count = 0;  // Number of maps that the quarantine leaves out.
  };

  explicit MapCollection(Options options);
  // Returns the options of the agent `self` with this team file; 0: of no agent.
  static Options OptionsOf(const proto::TeamConfig& team, AgentId self);

  // Adds a record of a node, an optimized pose, a map or a quarantine; ignores other records. Errors are those of
  // AddMap and of the conversion of poses and maps.
  Result<void> Add(const RecordKey& key, const proto::Record& record);

  // Adds a map, even if its node is still unknown. Errors are those of MakeLocalMap.
  Result<void> AddMap(const RecordKey& key, const Timestamp& timestamp, const TraversabilityMap& map);

  // Add poses of nodes (model/node_poses.h).
  void AddRawPose(const RecordKey& key, const NodeKey& node, const Pose& map_from_node, std::int64_t timestamp_ns = 0) {
    valid_.reset();
    poses_.AddRaw(key, node, map_from_node, timestamp_ns);
  }
  void AddOptimizedPose(const RecordKey& key, const NodeKey& node, const NodePoses::OptimizedPose& pose,
                        const proto::Term& term, std::uint64_t run) {
    valid_.reset();
    poses_.AddOptimized(key, node, pose, term, run);
  }
  Result<void> AddOptimizedPose(const RecordKey& key, const proto::OptimizedPose& optimized) {
    valid_.reset();
    return poses_.AddOptimized(key, optimized);
  }

  // Adds a record that quarantines maps or a node, or that lifts a quarantine. Other quarantines are only listed by
  // StandingQuarantines. A record may lift a quarantine that arrives later.
  void AddQuarantine(const RecordKey& key, const proto::MapQuarantine& quarantine);

  // Returns the input of Merger::Assign for a selection: the selected maps and footprints at the poses of their nodes.
  Selected Select(const Selection& selection) const;

  // Returns the node's valid pose (model/pose_carrier.h); null if it has none.
  const ValidPose* PoseOf(const NodeKey& node) const { return FindValid().Find(node); }
  Timestamp TimestampOf(const RecordKey& map) const;  // Returns Timestamp() for an unknown map.
  // Returns the quarantines that no record lifts, sorted by record key.
  std::vector<Quarantine> StandingQuarantines() const;

  // Number of records dropped because a limit was reached, by origin. Origins without dropped records are absent.
  std::map<AgentId, std::uint64_t> CountLeftOut() const;

  std::size_t map_count() const { return maps_.size(); }
  std::uint64_t map_bytes() const { return bytes_; }

 private:
  struct HeldMap {
    std::shared_ptr<const LocalMap> local;
    Timestamp timestamp;
  };

  const NodePoses::ValidPoses& FindValid() const;
  const Pose* FindPose(const NodeKey& node, bool use_raw_poses) const;
  bool HasStart(AgentId agent) const;
  // Returns whether the agent has a pose in the frame `map`, or will have one with its next node.
  bool IsPlaced(AgentId agent, bool use_raw_poses) const;
  // Returns whether the node's pose (FindPose) lies in the frame `map`.
  bool IsPlaced(const NodeKey& node, bool use_raw_poses) const;
  // Returns the unplaced rover whose maps alone the selection shows; 0 if there is none.
  AgentId FrameOf(const Selection& selection) const;
  const std::set<NodeKey>& QuarantinedNodes() const;
  void RemoveMap(const RecordKey& key);

  struct NoNote {};

  Options options_;
  std::map<RecordKey, HeldMap> maps_;
  OriginQuota<NoNote> map_quota_;
  OriginQuota<NoNote> map_bytes_quota_;
  QuarantineSet quarantines_;
  mutable std::optional<std::set<NodeKey>> quarantined_nodes_;  // Derived from `quarantines_` when needed.
  NodePoses poses_;
  mutable std::optional<NodePoses::ValidPoses> valid_;  // Derived from `poses_` and `quarantines_` when needed.
  std::uint64_t bytes_ = 0;
};

}  // namespace moondb
