// KnownTracks: the raw odometry of all rovers, as far as the search for starts needs it (rover_track.h).
//
// The result depends only on the set of added records, not on their order. If nodes exceed their limit, the agents with
// the most nodes keep only the newest (model/origin_quota.h). Single-threaded.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>

#include "actors/registration/planar_offset.h"
#include "actors/registration/rover_track.h"
#include "model/ids.h"
#include "model/origin_quota.h"
#include "model/record_key.h"
#include "proto/record.pb.h"

namespace moondb {

class KnownTracks {
 public:
  // `nodes_max`: maximum number of nodes, and of odometry edges.
  explicit KnownTracks(std::size_t nodes_max) : nodes_(nodes_max), edges_(nodes_max) {}

  // Adds a node or an odometry edge between consecutive nodes; ignores other records. Call it once per record.
  void Add(const RecordKey& key, const proto::Record& record);

  // Returns the longest unbroken track of the agent (the newest of several); null without nodes.
  std::shared_ptr<const RoverTrack> FindTrack(AgentId agent) const;

  void CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const;

 private:
  // One kind of values by node. If a node has several records, the record with the smallest key counts.
  template <typename Value>
  class ByNode {
   public:
    explicit ByNode(std::size_t count_max) : quota_(count_max) {}
    void Add(const RecordKey& key, const NodeKey& node, const Value& value);
    const Value* Find(const NodeKey& node) const;
    const std::map<NodeKey, std::map<RecordKey, Value>>& values() const { return values_; }
    void CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const { quota_.CountLeftOut(counts); }

   private:
    std::map<NodeKey, std::map<RecordKey, Value>> values_;
    OriginQuota<NodeKey> quota_;
  };

  ByNode<PlanarOffset> nodes_;     // odom_from_node
  ByNode<Eigen::Matrix3d> edges_;  // By the later node: covariance along the axes of the earlier node.
};

}  // namespace moondb
