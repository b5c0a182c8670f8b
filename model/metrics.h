// How good a trajectory and a merged map are, against the truth.
//
// Share of agreeing cells is nearly blind here (a map that is free everywhere scores above 0.85), so maps are scored by
// their hazards with a tolerance, and by Cohen's kappa. Pure functions on plain values.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "model/error.h"
#include "model/geometry.h"
#include "model/ids.h"
#include "model/pose_graph.h"
#include "model/traversability_map.h"

namespace moondb {

struct TrajectoryError {
  double rmse_m = 0;  // Absolute trajectory error: root of the mean squared 3-D distance. 0 without a node.
  double max_m = 0;
  std::size_t node_count = 0;
  std::size_t missing_count = 0;  // Nodes of the truth that the estimate lacks; they are not in the figures above.
};

// Over all nodes of `agents` (usually the rovers: the base station knows its place), without any alignment.
TrajectoryError CompareTrajectories(const std::map<NodeKey, Pose>& estimate, const std::map<NodeKey, Pose>& truth,
                                    const std::vector<AgentId>& agents);

// truth_from_estimate that brings the nodes of both nearest to each other in the mean square; a turn about z only where
// `is_planar`. For graphs that stand in no map. The identity where fewer than two nodes are in both.
Pose FindAlignment(const std::map<NodeKey, Pose>& estimate, const std::map<NodeKey, Pose>& truth, bool is_planar);

// The poses that a graph's nodes carry.
std::map<NodeKey, Pose> PosesOf(const PoseGraph& graph);

struct MapAgreement {
  double precision = 0;  // Share of the map's hazard cells with a true hazard cell within the tolerance; 1 without any.
  double recall = 0;     // Share of the true hazard cells with a hazard cell of the map likewise; 1 without any.
  double f1 = 0;         // 2 p r / (p + r); 0 when both are 0.
  double hazard_iou = 0;  // F1 / (2 - F1).
  double kappa = 0;  // Cohen's, of free and hazard over the cells known in both; 0 without one, 1 for a perfect match.
  std::uint64_t map_hazard_count = 0;
  std::uint64_t true_hazard_count = 0;
  std::uint64_t known_in_both_count = 0;
};

inline constexpr int kHazardToleranceCells = 2;

// Origins and extents may differ; what lies outside a grid is unknown. The tolerance holds in x and y each (a square).
// kInvalid if the resolutions differ or the tolerance is not 0 to 100.
Result<MapAgreement> CompareMaps(const MergedMap& map, const MergedMap& truth,
                                 int tolerance_cells = kHazardToleranceCells);

}  // namespace moondb
