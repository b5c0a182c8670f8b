#include "actors/pgo/keep_still.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "actors/pgo/connected_parts.h"

namespace moondb {

namespace {

// Rovers that move together as one rigid body.
struct Group {
  std::vector<const Rover*> rovers;
  std::optional<Eigen::Vector3d> fixed_m;  // Position of a fixed node that accepted ranges join to the group.
};

// A node's position in the last and in the new solution.
struct Move {
  Eigen::Vector3d last_m;
  Eigen::Vector3d solved_m;
  double turn_rad = 0;  // Rotation from the solved yaw to the last yaw.
};

std::vector<Move> FindMoves(const CheckedGraph& graph, const Group& group, const LastSolution& last,
                            const State& state) {
  std::vector<Move> moves;
  for (const Rover* rover : group.rovers) {
    for (std::size_t node = rover->first; node < rover->first + rover->count; ++node) {
      const auto before = last.poses.find(graph.nodes[node].key);
      if (before == last.poses.end()) continue;
      const Pose solved = FromBlock(state.poses[node]);
      moves.push_back({before->second.position_m, solved.position_m, before->second.Yaw() - solved.Yaw()});
    }
  }
  return moves;
}

// Returns the motion (a rotation about z and a translation) that moves the solved positions closest to the last
// positions. With `pivot_m`, the motion is only a rotation about `pivot_m`.
Pose FindWayBack(const std::vector<Move>& moves, const std::optional<Eigen::Vector3d>& pivot_m) {
  Eigen::Vector3d last_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d solved_m = Eigen::Vector3d::Zero();
  for (const Move& move : moves) {
    last_m += move.last_m / static_cast<double>(moves.size());
    solved_m += move.solved_m / static_cast<double>(moves.size());
  }
  if (pivot_m) last_m = solved_m = *pivot_m;
  double sine = 0;
  double cosine = 0;
  for (const Move& move : moves) {
    const Eigen::Vector3d from = move.solved_m - solved_m;
    const Eigen::Vector3d to = move.last_m - last_m;
    // A node's heading counts like a point one metre ahead of the node. Headings decide the rotation of a group that
    // has not driven.
    sine += from.x() * to.y() - from.y() * to.x() + std::sin(move.turn_rad);
    cosine += from.head<2>().dot(to.head<2>()) + std::cos(move.turn_rad);
  }
  Pose back = Pose::FromPlanar(0, 0, std::atan2(sine, cosine));
  back.position_m = last_m - back * solved_m;
  return back;
}

bool IsWorthPublishing(const std::vector<Move>& moves, const Pose& back, const SolverOptions& options) {
  if (std::abs(back.Yaw()) > options.still_move_rad) return true;
  return std::any_of(moves.begin(), moves.end(), [&](const Move& move) {
    return (back * move.solved_m - move.solved_m).norm() > options.still_move_m;
  });
}

State Moved(const Group& group, const Pose& by, State state) {
  for (const Rover* rover : group.rovers) {
    for (std::size_t node = rover->first; node < rover->first + rover->count; ++node) {
      state.poses[node] = ToBlock(by * FromBlock(state.poses[node]));
    }
  }
  return state;
}

// Returns the groups to move: first the parts of the team joined by accepted ranges and loop closures, then each
// single rover.
std::vector<Group> FindGroups(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                              const std::vector<bool>& is_inlier) {
  std::map<AgentId, std::size_t> places;
  for (std::size_t i = 0; i < rovers.size(); ++i) places[rovers[i].agent] = i;
  ConnectedParts parts(rovers.size());
  std::vector<std::optional<Eigen::Vector3d>> fixed_m(rovers.size());
  for (std::size_t i = 0; i < graph.tested_count(); ++i) {
    if (!is_inlier[i]) continue;
    const auto [from_index, to_index] = graph.EndsOfTested(i);
    const CheckedNode& from = graph.nodes[from_index];
    const CheckedNode& to = graph.nodes[to_index];
    if (from.is_fixed || to.is_fixed) {
      fixed_m[places.at((from.is_fixed ? to : from).key.agent)] = (from.is_fixed ? from : to).raw.position_m;
    } else {
      parts.Join(places.at(from.key.agent), places.at(to.key.agent));
    }
  }
  std::map<std::size_t, Group> joined;
  for (std::size_t i = 0; i < rovers.size(); ++i) {
    Group& group = joined[parts.HeadOf(i)];
    group.rovers.push_back(&rovers[i]);
    if (fixed_m[i]) group.fixed_m = fixed_m[i];
  }
  std::vector<Group> groups;
  for (auto& [head, group] : joined) {
    if (group.rovers.size() > 1) groups.push_back(std::move(group));
  }
  for (std::size_t i = 0; i < rovers.size(); ++i) groups.push_back(Group{{&rovers[i]}, fixed_m[i]});
  return groups;
}

}  // namespace

State KeepStill(const CheckedGraph& graph, const std::vector<Rover>& rovers, const CostTerms& terms,
                const std::vector<bool>& is_inlier, const LastSolution& last, const SolverOptions& options,
                State state) {
  std::vector<bool> is_counted = is_inlier;
  std::fill_n(is_counted.begin(), graph.first_closure(), true);
  const double cost_max = terms.RobustCost(is_counted, state) + options.still_cost;
  for (const Group& group : FindGroups(graph, rovers, is_inlier)) {
    // Try a motion with translation first, then a rotation about the fixed node. Next to a fixed node even a small
    // translation may raise the cost, but a rotation about that node does not.
    for (const auto& pivot_m : {std::optional<Eigen::Vector3d>(), group.fixed_m}) {
      const std::vector<Move> moves = FindMoves(graph, group, last, state);
      if (moves.empty()) break;
      const Pose back = FindWayBack(moves, pivot_m);
      if (!IsWorthPublishing(moves, back, options)) continue;
      State moved = Moved(group, back, state);
      if (terms.RobustCost(is_counted, moved) < cost_max) state = std::move(moved);
    }
  }
  return state;
}

}  // namespace moondb
