#include "actors/registration/known_tracks.h"

#include <utility>
#include <vector>

#include "model/geometry.h"
#include "model/pose_graph.h"

namespace moondb {

template <typename Value>
void KnownTracks::ByNode<Value>::Add(const RecordKey& key, const NodeKey& node, const Value& value) {
  if (!values_[node].emplace(key, value).second) return;
  for (const auto& removed : quota_.Add(key, 1, node)) {
    const auto found = values_.find(removed.note);
    found->second.erase(removed.key);
    if (found->second.empty()) values_.erase(found);
  }
}

template <typename Value>
const Value* KnownTracks::ByNode<Value>::Find(const NodeKey& node) const {
  const auto found = values_.find(node);
  return found == values_.end() ? nullptr : &found->second.begin()->second;
}

void KnownTracks::Add(const RecordKey& key, const proto::Record& record) {
  if (record.has_pose_graph_node()) {
    const Result<Pose> pose = FromProto(record.pose_graph_node().map_from_node());
    if (pose) nodes_.Add(key, FromProto(record.pose_graph_node().node()), PlanarOffset::From(*pose));
    return;
  }
  if (!record.has_pose_graph_edge() || !record.pose_graph_edge().has_relative_pose()) return;
  const proto::PoseGraphEdge& edge = record.pose_graph_edge();
  const NodeKey from = FromProto(edge.from());
  const NodeKey to = FromProto(edge.to());
  if (!edge.source().empty() || from.agent != to.agent || from.index + 1 != to.index) return;
  Result<Matrix6d> covariance = FromUpperTriangle(edge.relative_pose().covariance());
  if (!covariance) return;
  LimitVariances(*covariance);
  constexpr int kPlanar[] = {0, 1, 5};
  Eigen::Matrix3d planar;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) planar(row, column) = (*covariance)(kPlanar[row], kPlanar[column]);
  }
  edges_.Add(key, to, planar);
}

std::shared_ptr<const RoverTrack> KnownTracks::FindTrack(AgentId agent) const {
  std::vector<RoverTrack::Step> longest, steps;
  const auto end_part = [&] {
    if (steps.size() >= longest.size()) longest = std::move(steps);
    steps.clear();
  };
  const auto& nodes = nodes_.values();
  for (auto node = nodes.lower_bound({agent, 0}); node != nodes.end() && node->first.agent == agent; ++node) {
    RoverTrack::Step step{node->first, node->second.begin()->second};
    if (!steps.empty()) {
      const RoverTrack::Step& before = steps.back();
      const Eigen::Matrix3d* const covariance = edges_.Find(step.node);
      const double moved_m = (step.odom_from_node.position_m() - before.odom_from_node.position_m()).norm();
      if (covariance == nullptr || step.node.index != before.node.index + 1 || moved_m > RoverTrack::kStepMax_m) {
        end_part();
      } else {
        step.covariance = TurnedCovariance(*covariance, before.odom_from_node.yaw_rad);
      }
    }
    steps.push_back(step);
  }
  end_part();
  return longest.empty() ? nullptr : std::make_shared<const RoverTrack>(longest);
}

void KnownTracks::CountLeftOut(std::map<AgentId, std::uint64_t>& counts) const {
  nodes_.CountLeftOut(counts);
  edges_.CountLeftOut(counts);
}

}  // namespace moondb
