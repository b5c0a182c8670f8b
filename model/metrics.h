// Computes how well estimated trajectories and merged maps agree with the true ones.
//
// The fraction of agreeing cells is a poor metric: a map that is free everywhere scores above 0.85. CompareMaps
// therefore compares hazards, with a tolerance, and computes Cohen's kappa. Thread-safe.
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
  double rmse_m = 0;  // Absolute trajectory error: root mean square of the 3-D distances; 0 if there are no nodes.
  double max_m = 0;
  std::size_t node_count = 0;
  std::size_t missing_count = 0;  // Nodes of the truth that the estimate lacks; excluded from the errors.
};

// Compares all nodes of `agents`, without aligning the trajectories first. `agents` are usually the rovers, because the
// base station's position is known.
TrajectoryError CompareTrajectories(const std::map<NodeKey, Pose>& estimate, const std::map<NodeKey, Pose>& truth,
                                    const std::vector<AgentId>& agents);

// Returns the pose truth_from_estimate that aligns the nodes that `estimate` and `truth` have in common, with least
// squared error. Returns the identity if there are fewer than two such nodes. If `is_planar`, the pose rotates only
// about z. Use it for graphs whose position in the frame `map` is not determined.
Pose FindAlignment(const std::map<NodeKey, Pose>& estimate, const std::map<NodeKey, Pose>& truth, bool is_planar);

// Returns the poses of a graph's nodes.
std::map<NodeKey, Pose> PosesOf(const PoseGraph& graph);

struct MapAgreement {
  // Fraction of the map's hazard cells with a true hazard cell within the tolerance; 1 if the map has no hazards.
  double precision = 0;
  // Fraction of the true hazard cells with a hazard cell of the map within the tolerance; 1 if there are no true
  // hazards.
  double recall = 0;
  double f1 = 0;          // 2 p r / (p + r) for precision p and recall r; 0 if both are 0.
  double hazard_iou = 0;  // Intersection over union of hazards: F1 / (2 - F1).
  // Cohen's kappa of free and hazard, over the cells known in both maps; 0 if there are no such cells, 1 for a perfect
  // match.
  double kappa = 0;
  std::uint64_t map_hazard_count = 0;
  std::uint64_t true_hazard_count = 0;
  std::uint64_t known_in_both_count = 0;
};

inline constexpr int kHazardToleranceCells = 2;

// Compares a merged map with the true map. Their origins and extents may differ; cells outside a grid count as unknown.
// The tolerance applies to x and y separately (a square). Fails with kInvalid if the resolutions differ or the
// tolerance is not 0 to 100.
Result<MapAgreement> CompareMaps(const MergedMap& map, const MergedMap& truth,
                                 int tolerance_cells = kHazardToleranceCells);

// How a cell of a merged map compares with the same cell of the true map.
enum class HazardMatch : std::uint8_t {
  kUnknown = 0,  // Unknown in both maps.
  kFree = 1,     // A hazard in neither map.
  kHit = 2,      // A hazard of one map, with a hazard of the other within the tolerance.
  kMissed = 3,   // A hazard of the true map, with none of the merged map within the tolerance.
  kPhantom = 4,  // A hazard of the merged map, with none of the true map within the tolerance.
};

// Returns one value per cell, in the order of Grid::cells. Fails with kInvalid as CompareMaps does, and if the two maps
// do not cover the same cells.
Result<std::vector<HazardMatch>> MatchHazardCells(const MergedMap& map, const MergedMap& truth,
                                                  int tolerance_cells = kHazardToleranceCells);

}  // namespace moondb
