#include "actors/registration/match_candidates.h"

#include <algorithm>
#include <map>

namespace moondb {
namespace {

constexpr double kHeightSigma_m = 1;
constexpr double kTiltSigma_rad = 0.2;

bool IsNeighbour(const NodeKey& a, const NodeKey& b, std::uint64_t apart_nodes) {
  return a.agent == b.agent && (a.index > b.index ? a.index - b.index : b.index - a.index) < apart_nodes;
}

}  // namespace

std::vector<MatchCandidate> FindCandidates(const std::vector<RegisteredMap>& maps, std::size_t index,
                                           const CandidateOptions& options) {
  const RegisteredMap& map = maps[index];
  std::vector<MatchCandidate> near;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    if (i == index || IsNeighbour(map.node, maps[i].node, options.apart_nodes)) continue;
    const double distance_m = (map.map_from_local.position_m - maps[i].map_from_local.position_m).head<2>().norm();
    if (distance_m <= options.distance_max_m) near.push_back({std::min(i, index), std::max(i, index), distance_m});
  }
  std::ranges::sort(near, [](const MatchCandidate& a, const MatchCandidate& b) {
    return std::tie(a.distance_m, a.first, a.second) < std::tie(b.distance_m, b.first, b.second);
  });
  std::map<AgentId, std::size_t> counts;
  std::vector<MatchCandidate> candidates;
  for (const MatchCandidate& candidate : near) {
    const RegisteredMap& other = maps[candidate.first == index ? candidate.second : candidate.first];
    if (candidates.size() == options.of_map_max || ++counts[other.node.agent] > options.of_agent_max) continue;
    candidates.push_back(candidate);
  }
  return candidates;
}

LoopClosure ToLoopClosure(const RegisteredMap& first, const Pose& map_from_first_node, const RegisteredMap& second,
                          const Pose& map_from_second_node, const MatchResult& match) {
  // Both local frames are levelled: the match holds between their projections to the horizontal plane.
  const Pose first_local = PlanarOffset::From(first.map_from_local).ToPose();
  const Pose second_local = PlanarOffset::From(second.map_from_local).ToPose();
  const Pose correction = first_local * match.first_from_second.ToPose() * second_local.Inverse();
  LoopClosure closure;
  closure.from = first.node;
  closure.to = second.node;
  closure.timestamp_ns = std::max(first.timestamp_ns, second.timestamp_ns);
  const Pose first_from_map = map_from_first_node.Inverse();
  closure.from_from_to = first_from_map * correction * map_from_second_node;
  closure.source = "registration";

  // The covariance of the match belongs to the origin of the second local frame. The node lies beside it, so a turn of
  // the local frame also moves the node.
  const Eigen::Vector3d node_from_local_m = map_from_second_node.position_m - second.map_from_local.position_m;
  const Eigen::Vector2d arm_m = (match.first_from_second.ToPose() * second_local.Inverse() *
                                 Pose{second_local.position_m + node_from_local_m, {}})
                                    .position_m.head<2>() -
                                match.first_from_second.ToPose().position_m.head<2>();
  Eigen::Matrix3d shift = Eigen::Matrix3d::Identity();
  shift(0, 2) = -arm_m.y();
  shift(1, 2) = arm_m.x();
  const Eigen::Matrix3d planar = shift * match.covariance * shift.transpose();
  Matrix6d covariance = Matrix6d::Zero();
  const int at[] = {0, 1, 5};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) covariance(at[row], at[column]) = planar(row, column);
  }
  covariance(2, 2) = kHeightSigma_m * kHeightSigma_m;
  covariance(3, 3) = covariance(4, 4) = kTiltSigma_rad * kTiltSigma_rad;
  // Rotate from the first local frame, levelled, to the frames of the nodes: translation along the axes of the first
  // node, rotation about those of the second.
  const Eigen::Matrix3d first_turn = (first_from_map.orientation * first_local.orientation).toRotationMatrix();
  const Eigen::Matrix3d second_turn =
      (map_from_second_node.orientation.conjugate() * second_local.orientation).toRotationMatrix();
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = first_turn;
  turn.bottomRightCorner<3, 3>() = second_turn;
  closure.covariance = turn * covariance * turn.transpose();
  return closure;
}

}  // namespace moondb
