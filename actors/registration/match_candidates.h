// Choice of the pairs of maps that are matched, and the conversion of a match to a loop closure.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "actors/registration/map_matching.h"
#include "model/pose_graph.h"
#include "model/record_key.h"

namespace moondb {

// A local map, as far as the choice needs it.
struct RegisteredMap {
  RecordKey key;
  NodeKey node;
  std::int64_t timestamp_ns = 0;
  Pose map_from_node;   // Newest optimized pose of the node in the frame `map`.
  Pose map_from_local;  // The same of the local map.
};

// Numbers of two maps in a list, first < second, and the horizontal distance of their origins.
struct MatchCandidate {
  std::size_t first = 0;
  std::size_t second = 0;
  double distance_m = 0;
};

struct CandidateOptions {
  double distance_max_m = 6;
  std::size_t of_agent_max = 3;  // Nearest maps of each agent.
  std::size_t of_map_max = 16;
  std::uint64_t apart_nodes = 10;  // Two maps of one agent belong to nodes at least this far apart.
  // One map of a dense drive is matched for each stretch of this length, or of this turn.
  double apart_m = 0.3;
  double apart_rad = 0.26;  // 15 degrees.
  // If more maps of one agent lie in one square of half a metre, only the last ones of the list are matched.
  std::size_t of_square_max = 8;
};

// Returns the pairs of maps to match, nearest first: for each map the nearest maps of each agent, itself included.
// Pairs of agents for which `are_joined` is false are left out, because their relative pose is unknown.
std::vector<MatchCandidate> FindCandidates(const std::vector<RegisteredMap>& maps, const CandidateOptions& options,
                                           const std::function<bool(AgentId, AgentId)>& are_joined);

// Returns the match as a loop closure between the nodes of two maps. The match corrects x, y and yaw of the second map.
// z, roll and pitch stay as they are, with sigmas of 1 m and 0.2 rad.
//
// The sigma of yaw is three times that of the match, because the matches of one map share its errors, and the odometry
// knows the yaw better (docs/decisions/0016).
LoopClosure ToLoopClosure(const RegisteredMap& first, const RegisteredMap& second, const MatchResult& match);

}  // namespace moondb
