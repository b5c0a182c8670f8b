// NodePoses: the raw and optimized poses of nodes, and which of them is valid (model/pose_carrier.h).
//
// The result depends only on the set of added records, not on their order. If raw poses exceed the limit, the agents
// with the most records keep only their newest (model/origin_quota.h). If optimized poses exceed the limit, the agents
// with the most nodes keep only the poses of their nodes with the highest indices. Single-threaded.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "model/error.h"
#include "model/geometry.h"
#include "model/ids.h"
#include "model/origin_quota.h"
#include "model/pose_carrier.h"
#include "model/record_key.h"
#include "proto/record.pb.h"
#include "proto/term.pb.h"

namespace moondb {

class NodePoses {
 public:
  // `nodes_max`: maximum number of node records, and of nodes with an optimized pose.
  explicit NodePoses(std::size_t nodes_max) : nodes_max_(nodes_max), quota_(nodes_max) {}

  // A record of a node's pose from odometry.
  struct RawPose {
    RecordKey key;
    Pose map_from_node;
    std::int64_t timestamp_ns = 0;
  };

  // Adds a node's pose from odometry. If a node has several such records, the record with the smallest key is valid.
  void AddRaw(const RecordKey& key, const NodeKey& node, const Pose& map_from_node, std::int64_t timestamp_ns = 0);

  struct OptimizedPose {
    Pose map_from_node;
    bool ignores_raw_pose = false;  // True: valid even while a quarantine of the node stands.
    // True: the solve could not place the rover in the frame `map`; the pose lies in a frame of the rover's own.
    bool is_unplaced = false;
  };

  // Adds an optimized pose. Among several poses of a node, the pose with the highest (term, run) is valid.
  void AddOptimized(const RecordKey& key, const NodeKey& node, const OptimizedPose& pose, const proto::Term& term,
                    std::uint64_t run);
  // Fails with the error of FromProto(proto::Pose), without changing anything.
  Result<void> AddOptimized(const RecordKey& key, const proto::OptimizedPose& optimized);

  // Return null if there is no such pose. `is_quarantined`: a quarantine of the node stands.
  const Pose* FindRaw(const NodeKey& node, bool is_quarantined) const;
  const OptimizedPose* FindOptimized(const NodeKey& node, bool is_quarantined) const;
  // Returns whether any optimized pose of the agent lies in the frame `map`; nullopt if it has no optimized pose.
  std::optional<bool> IsPlaced(AgentId agent) const;
  bool HasNode(AgentId agent) const;
  // Returns the valid record of the node's raw pose, even if a quarantine stands; null if there is none.
  const RawPose* FindRawRecord(const NodeKey& node) const;

  // Calls `take(node)` for each node, in ascending order.
  template <typename Take>
  void ForEach(const Take& take) const {
    for (const auto& [node, poses] : nodes_) take(node);
  }

  // The valid poses of nodes.
  struct ValidPoses {
    std::vector<std::pair<NodeKey, ValidPose>> poses;  // Sorted by node.
    // First node of each rover that odometry does not connect with the rover's last optimized pose. It and the newer
    // nodes without an optimized pose have no valid pose.
    std::map<AgentId, std::uint64_t> cut_at;

    const ValidPose* Find(const NodeKey& node) const;  // Null if the node has no valid pose.
  };
  // `quarantined`: nodes with a standing quarantine.
  ValidPoses FindValid(const std::set<NodeKey>& quarantined) const;

  // Adds the number of records dropped because of the limit: raw poses by origin, optimized poses by the node's agent.
  void CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const;

 private:
  // Order of a node's optimized poses: term number, issuer and epoch, then run, then record key. The greatest is valid.
  using Version = std::tuple<std::uint64_t, std::uint32_t, std::uint64_t, std::uint64_t, RecordKey>;

  struct Versioned {
    Version version;
    OptimizedPose pose;
  };

  struct Poses {
    std::vector<RawPose> raw;  // Poses from odometry, sorted by key; usually one.
    std::optional<Versioned> optimized;
  };

  // Optimized poses of the nodes of one agent.
  struct OptimizedShare {
    std::size_t count = 0;          // Number of nodes with an optimized pose.
    std::size_t placed_count = 0;   // Number of those that are not unplaced.
    std::uint64_t first_index = 0;  // Optimized poses of nodes with a lower index have no room.
    std::uint64_t left_out_count = 0;
  };

  static const OptimizedPose* ValidOf(const Poses& poses, bool is_quarantined);
  void DropOptimized();

  std::size_t nodes_max_;
  std::map<NodeKey, Poses> nodes_;
  OriginQuota<NodeKey> quota_;
  std::size_t optimized_count_ = 0;  // Number of nodes with an optimized pose: the sum of `count` in optimized_shares_.
  std::map<AgentId, OptimizedShare> optimized_shares_;
};

}  // namespace moondb
