// Choice of the pairs of maps that are matched, and the conversion of a match to a loop closure.
#pragma once

#include <cstddef>
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
  Pose map_from_local;  // Newest pose of the local map in the frame `map`.
};

// Numbers of two maps in a list, and the distance of their origins.
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
};

// Returns the candidates of maps[index] among all maps, nearest first. `first` is the smaller number.
std::vector<MatchCandidate> FindCandidates(const std::vector<RegisteredMap>& maps, std::size_t index,
                                           const CandidateOptions& options = {});

// Returns the match as a loop closure between the nodes of two maps. The match corrects x, y and yaw of the second map.
// z, roll and pitch stay as they are, with sigmas of 1 m and 0.2 rad.
LoopClosure ToLoopClosure(const RegisteredMap& first, const Pose& map_from_first_node, const RegisteredMap& second,
                          const Pose& map_from_second_node, const MatchResult& match);

}  // namespace moondb
