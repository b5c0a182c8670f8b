// MapCollection: the maps, node poses and quarantines that an agent knows, kept between merges. What a Merger merges.
//
// The collection depends on the set of records alone, not on the order in which they come; each record comes once.
// Where records of a kind exceed their limit, the agents with most of them keep their newest ones
// (model/origin_quota.h), and CountLeftOut says how many were left out. One exception: optimized poses of more than
// nodes_max nodes are left out in the order in which they come. Leaders alone state these. Poses are as wide as
// model/geometry.h admits. Used by one thread at a time.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "actors/merge/placement.h"
#include "model/error.h"
#include "model/ids.h"
#include "model/origin_quota.h"
#include "model/record_key.h"
#include "model/traversability_map.h"
#include "proto/record.pb.h"

namespace moondb {

class MapCollection {
 public:
  struct Options {
    MergeGrid grid;
    std::set<AgentId> without_footprint;  // Base stations: they stand still and are no rovers.
    std::size_t maps_max = 65535;
    std::uint64_t bytes_max = 8ull << 30;  // Of all maps together.
    std::size_t nodes_max = 4'000'000;     // Records of nodes, and nodes with an optimized pose.
    std::size_t quarantines_max = 65535;   // Quarantines, and records that lift one.
  };

  // Of one merge.
  struct Selection {
    bool use_raw_poses = false;  // Ignore optimized poses.
    std::set<AgentId> agents;    // Only maps of these origins and footprints of their nodes; empty: all.

    bool is_everything() const { return !use_raw_poses && agents.empty(); }
  };

  struct Selected {
    std::vector<PlacedMap> maps;                                    // By record key.
    std::vector<Footprint> footprints;                              // By node.
    std::vector<std::shared_ptr<const LocalMap>> waiting_maps;      // Selected, but their node is not known.
    std::vector<std::shared_ptr<const LocalMap>> quarantined_maps;  // Selected, but left out.
  };

  struct NodePose {
    Pose map_from_node;
    bool is_optimized = false;
  };

  // As its origin stamped it.
  struct Timestamp {
    std::int64_t ns = 0;
    bool is_clock_suspect = false;  // Then it wins nothing by being newer.
  };

  struct Quarantine {
    RecordKey key;
    proto::MapQuarantine said;
    std::size_t map_count = 0;  // Maps that it leaves out.
  };

  explicit MapCollection(Options options);

  // Its node may come later. Errors: kInvalid as in MakeLocalMap.
  Result<void> AddMap(const RecordKey& key, const Timestamp& timestamp, const TraversabilityMap& map);

  // The pose as odometry has it. Of two records of one node the smaller key stands, as everywhere.
  void AddRawPose(const RecordKey& key, const NodeKey& node, const Pose& map_from_node);

  // The newest (term, run) of a node wins.
  void AddOptimizedPose(const RecordKey& key, const NodeKey& node, const Pose& map_from_node, const proto::Term& term,
                        std::uint64_t run);

  // Leaves maps out until another record lifts it, or lifts one that may not have come yet.
  void AddQuarantine(const RecordKey& key, const proto::MapQuarantine& quarantine);

  // Everything that Merger::Assign needs of the selection: maps and footprints at the newest poses.
  Selected Select(const Selection& selection) const;

  // The newest one; nothing where the node is not known.
  std::optional<NodePose> PoseOf(const NodeKey& node) const;
  Timestamp TimestampOf(const RecordKey& map) const;  // Of a map that is here.
  // Those that no other lifts, by record key.
  std::vector<Quarantine> StandingQuarantines() const;

  // The number of records for which there was no room, of each origin that has such.
  std::map<AgentId, std::uint64_t> CountLeftOut() const;

  std::size_t map_count() const { return maps_.size(); }
  std::uint64_t map_bytes() const { return bytes_; }

 private:
  // Number, issuer and epoch of the term, run, and the record's key to decide between equal ones.
  using Version = std::tuple<std::uint64_t, std::uint32_t, std::uint64_t, std::uint64_t, RecordKey>;

  struct Node {
    std::vector<std::pair<RecordKey, Pose>> raw;  // By key; a second one is rare.
    std::optional<std::pair<Version, Pose>> optimized;
  };

  struct HeldMap {
    std::shared_ptr<const LocalMap> local;
    Timestamp timestamp;
  };

  const Pose* FindPose(const NodeKey& node, bool use_raw_poses) const;
  // Stamps of the maps that are left out, by agent: apart from each other and sorted.
  using Spans = std::map<AgentId, std::vector<std::pair<std::int64_t, std::int64_t>>>;
  Spans StandingSpans() const;
  static bool IsLeftOut(const Spans& spans, const HeldMap& map);
  void RemoveMap(const RecordKey& key);
  void RemoveRawPose(const RecordKey& key, const NodeKey& node);

  struct NoNote {};

  Options options_;
  std::map<RecordKey, HeldMap> maps_;
  OriginQuota<NoNote> map_quota_;
  OriginQuota<NoNote> map_bytes_quota_;
  std::map<RecordKey, proto::MapQuarantine> quarantines_;
  std::multiset<RecordKey> lifted_;
  OriginQuota<std::optional<RecordKey>> quarantine_quota_;  // With what the record lifts.
  std::map<NodeKey, Node> nodes_;
  OriginQuota<NodeKey> node_quota_;
  std::size_t optimized_count_ = 0;                       // Nodes.
  std::map<AgentId, std::uint64_t> left_out_pose_count_;  // Optimized ones.
  std::uint64_t bytes_ = 0;
};

}  // namespace moondb
