#include "actors/registration/match_candidates.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <ranges>
#include <tuple>

namespace moondb {
namespace {

constexpr double kThinningSide_m = 0.5;
constexpr double kYawFactor = 9;  // Factor of the variance of yaw.
constexpr double kHeightSigma_m = 1;
constexpr double kTiltSigma_rad = 0.2;

bool IsNeighbour(const NodeKey& a, const NodeKey& b, std::uint64_t apart_nodes) {
  return a.agent == b.agent && (a.index > b.index ? a.index - b.index : b.index - a.index) < apart_nodes;
}

// Returns the maps that are matched, by number. An agent's maps in the order of their nodes form stretches of less than
// apart_m and apart_rad. The last map of each stretch is matched.
std::vector<std::size_t> ThinOut(const std::vector<RegisteredMap>& maps, const CandidateOptions& options) {
  std::vector<std::size_t> order(maps.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::stable_sort(order, {}, [&](std::size_t index) { return maps[index].node; });
  std::vector<std::size_t> matched;
  const RegisteredMap* first = nullptr;  // First map of the stretch.
  for (const std::size_t index : order) {
    const RegisteredMap& map = maps[index];
    if (first != nullptr && first->node.agent == map.node.agent) {
      const PlanarOffset moved = PlanarOffset::Between(first->map_from_local, map.map_from_local);
      if (moved.position_m().norm() < options.apart_m && std::abs(moved.yaw_rad) < options.apart_rad) {
        matched.back() = index;
        continue;
      }
    }
    matched.push_back(index);
    first = &map;
  }
  std::ranges::sort(matched);
  return matched;
}

bool IsNearer(const MatchCandidate& a, const MatchCandidate& b) {
  return std::tie(a.distance_m, a.first, a.second) < std::tie(b.distance_m, b.first, b.second);
}

}  // namespace

std::vector<MatchCandidate> FindCandidates(const std::vector<RegisteredMap>& maps, const CandidateOptions& options,
                                           const std::function<bool(AgentId, AgentId)>& are_joined) {
  const auto square_of = [](const RegisteredMap& map, double side_m) {
    return std::pair(static_cast<std::int64_t>(std::floor(map.map_from_local.position_m.x() / side_m)),
                     static_cast<std::int64_t>(std::floor(map.map_from_local.position_m.y() / side_m)));
  };
  std::map<std::tuple<AgentId, std::int64_t, std::int64_t>, std::size_t> counts;
  std::map<std::pair<std::int64_t, std::int64_t>, std::vector<std::size_t>> squares;
  for (const std::size_t i : std::views::reverse(ThinOut(maps, options))) {
    const auto [x, y] = square_of(maps[i], kThinningSide_m);
    if (++counts[{maps[i].node.agent, x, y}] > options.of_square_max) continue;
    squares[square_of(maps[i], options.distance_max_m)].push_back(i);
  }
  std::map<std::pair<std::size_t, std::size_t>, double> pairs;
  const auto add_pairs_of = [&](std::size_t index, const std::pair<std::int64_t, std::int64_t>& square) {
    const RegisteredMap& map = maps[index];
    std::vector<MatchCandidate> near;
    for (std::int64_t y = square.second - 1; y <= square.second + 1; ++y) {
      for (std::int64_t x = square.first - 1; x <= square.first + 1; ++x) {
        const auto others = squares.find({x, y});
        if (others == squares.end()) continue;
        for (const std::size_t other : others->second) {
          if (other == index || IsNeighbour(map.node, maps[other].node, options.apart_nodes)) continue;
          if (!are_joined(map.node.agent, maps[other].node.agent)) continue;
          const double distance_m =
              (map.map_from_local.position_m - maps[other].map_from_local.position_m).head<2>().norm();
          if (distance_m <= options.distance_max_m) near.push_back({index, other, distance_m});
        }
      }
    }
    std::ranges::sort(near, IsNearer);
    std::map<AgentId, std::size_t> of_agent;
    std::size_t count = 0;
    for (const MatchCandidate& candidate : near) {
      if (count == options.of_map_max) break;
      if (++of_agent[maps[candidate.second].node.agent] > options.of_agent_max) continue;
      ++count;
      pairs.emplace(std::minmax(candidate.first, candidate.second), candidate.distance_m);
    }
  };
  for (const auto& [square, indices] : squares) {
    for (const std::size_t index : indices) add_pairs_of(index, square);
  }
  std::vector<MatchCandidate> candidates;
  for (const auto& [pair, distance_m] : pairs) candidates.push_back({pair.first, pair.second, distance_m});
  std::ranges::sort(candidates, IsNearer);
  return candidates;
}

LoopClosure ToLoopClosure(const RegisteredMap& first, const RegisteredMap& second, const MatchResult& match) {
  // The match holds between the projections of both local frames to the horizontal plane.
  const Pose first_local = PlanarOffset::From(first.map_from_local).ToPose();
  const Pose second_local = PlanarOffset::From(second.map_from_local).ToPose();
  const Pose correction = first_local * match.first_from_second.ToPose() * second_local.Inverse();
  LoopClosure closure;
  closure.from = first.node;
  closure.to = second.node;
  closure.timestamp_ns = std::max(first.timestamp_ns, second.timestamp_ns);
  const Pose first_from_map = first.map_from_node.Inverse();
  closure.from_from_to = first_from_map * correction * second.map_from_node;
  closure.source = kRegistrationSource;

  // The covariance of the match belongs to the origin of the second local frame. The node lies beside it, so a turn of
  // the local frame also moves the node.
  const Eigen::Vector3d node_from_local_m = second.map_from_node.position_m - second.map_from_local.position_m;
  const Eigen::Vector2d arm_m = (match.first_from_second.ToPose() * second_local.Inverse() *
                                 Pose{second_local.position_m + node_from_local_m, {}})
                                    .position_m.head<2>() -
                                match.first_from_second.ToPose().position_m.head<2>();
  const Eigen::Matrix3d planar = ShiftedCovariance(match.covariance, arm_m);
  Matrix6d covariance = Matrix6d::Zero();
  const int at[] = {0, 1, 5};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) covariance(at[row], at[column]) = planar(row, column);
  }
  covariance(5, 5) *= kYawFactor;
  covariance(2, 2) = kHeightSigma_m * kHeightSigma_m;
  covariance(3, 3) = covariance(4, 4) = kTiltSigma_rad * kTiltSigma_rad;
  // Rotate from the first local frame, levelled, to the frames of the nodes: translation along the axes of the first
  // node, rotation about those of the second.
  const Eigen::Matrix3d first_turn = (first_from_map.orientation * first_local.orientation).toRotationMatrix();
  const Eigen::Matrix3d second_turn =
      (second.map_from_node.orientation.conjugate() * second_local.orientation).toRotationMatrix();
  Matrix6d turn = Matrix6d::Zero();
  turn.topLeftCorner<3, 3>() = first_turn;
  turn.bottomRightCorner<3, 3>() = second_turn;
  closure.covariance = turn * covariance * turn.transpose();
  return closure;
}

}  // namespace moondb
