// SolvePoseGraph: where everybody was, from odometry and ranges (paper, Section 5.2: poses, VIO edges and UWB edges
// handed to Ceres).
//
// Minimises over the poses x, each rover's odometry scale s and each pair of radios' bias b
//
//   F = 1/2 ( sum_odometry |r|^2 + sum_range |r|^2                      actors/pgo/factors.h
//           + sum_rover |start prior|^2 + sum_node |gravity|^2 + sum (s / 2 %)^2 + sum (b / 0.1 m)^2 )
//
// in stages: leave out what is damaged (graph_check.h) -> begin at the last solution (initial_values.h) -> ranges under
// a Cauchy loss, which one long range in twenty cannot pull away -> reject ranges beyond 3.5 sigma -> least squares on
// the rest, ranges tested anew, until the tests say the same as before. UWB through walls and around rocks measures too
// long in bursts, and least squares on such ranges is worse than odometry alone.
//
// A warm solve (nearly all nodes have been solved before) begins at the last verdicts instead of the Cauchy stage: an
// unchanged graph stays where it is. Where a rover's new ranges do not fit its first guess, a Cauchy stage judges them
// and those that were rejected, while the accepted ones count fully. What moved as a whole without cause goes back
// (keep_still.h). A rover without a configured start is set down by its ranges (unknown_starts.h), in every solve anew:
// elsewhere only where that is better by `ambiguous_cost` than where it stands.
//
// A solution is accepted only if all numbers are finite, Ceres converged, and F over the accepted ranges is no higher
// than where the solve began. A warm one that is not, or that rejects most ranges of a rover, is solved from odometry,
// too, and the lower robust cost counts. If none is accepted, `poses` are the initial values and `text` says why: never
// a crash.
//
// Deterministic: the same values in any order give the same solution, to the last bit for one thread count and binary.
// A pure function of its arguments; may run on any thread. How long it takes: docs/benchmarks/pose_graph.md.
//
//   SolverOptions options;
//   options.thread_count = 1;
//   const Solution solution = SolvePoseGraph(graph, agents, /*last_solution=*/{}, options);
//   if (solution.is_accepted) Publish(solution.poses);
#pragma once

#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "model/pose_graph.h"

namespace moondb {

// Which way is up at a node. Raw poses come from visual-inertial odometry, which feels gravity: their roll and pitch
// are right on slopes too. Recordings made on a floor have bare sums of noisy steps for raw poses, whose tilt is worth
// nothing; there the ground is level. kChosen: for each rover by what its own way shows (ground.h).
enum class GravityReference { kChosen, kRawPoses, kLevelGround };

struct SolverOptions {
  int thread_count = 2;         // Of Ceres; 1 in simulation.
  int iterations_max = 100;     // Of each stage.
  double cauchy_sigmas = 2;     // Where the robust stage begins to doubt a range.
  double huber_sigmas = 1.345;  // Of Huber's loss, which is here for comparison only.
  double reject_sigmas = 3.5;   // Beyond this a range is left out of the last stage.
  double burst_sigmas = 2.5;    // The same, next to a rejected range of the same pair that errs the same way.
  double scale_sigma = 0.02;    // Of a rover's odometry scale about 1.
  double bias_sigma_m = 0.10;   // Of a pair's constant range error about 0.
  GravityReference gravity_reference = GravityReference::kChosen;
  double gravity_sigma_rad = 0.02;  // Of roll and pitch, about that reference.
  double ambiguous_cost = 10;       // Two solutions whose F (robust) differ by less are distinguished by nothing.
  // What moved as a whole by more than either goes back where it was last, unless that costs more (keep_still.h).
  double still_move_m = 0.01;
  double still_move_rad = 0.002;
  double still_cost = 0.25;
  double loose_sigma_m = 10;  // Of a first pose without configured start that no ranges join, and beyond a gap.
  double loose_sigma_rad = 1;
  // Only this many newest nodes of each rover move, and those that no solve has placed yet; scales, biases and all else
  // stand. For a quick answer. 0: all. All move, too, where less than 80 % of the nodes have been solved before, and
  // where a rover without a configured start might stand elsewhere.
  std::size_t window_nodes = 0;
  // Nodes whose covariance is wanted, too. Costs about as much as a warm solve.
  std::vector<NodeKey> covariance_of = {};
  // Polled once per iteration; true ends the solve, which then is not accepted.
  std::function<bool()> stop_requested = {};
};

// Where a solve goes on from: what was published last, by this leader or another.
struct LastSolution {
  std::map<NodeKey, Pose> poses;  // map_from_node.
  std::set<RangeKey> rejected;    // Ranges between these nodes; others of them were accepted.
};

enum class Anchoring {
  kAnchored,    // Accepted ranges join it, directly or over others, with a configured start or two base stations.
  kNoRanges,    // A configured start, then odometry alone: no accepted range to anybody who is in the map.
  kYawFree,     // Ranges join it with one base station and no start: all may turn about the base station.
  kAmbiguous,   // Somewhere else it would stand nearly as well.
  kUnanchored,  // Nothing ties it to the map: its poses are right among themselves only.
};

// Where the solve that counts began.
enum class SolveInitialValues {
  kOdometry,        // Start poses and odometry.
  kLastSolution,    // With at least 80 % of the nodes that do not stand fixed.
  kArrangedRovers,  // Rovers without a known start were set down by their ranges.
};

// "odometry", "warm", "stage 0".
std::string ToString(SolveInitialValues initial_values);

struct RoverResult {
  AgentId agent = 0;
  Anchoring anchoring = Anchoring::kUnanchored;
  double odometry_scale = 1;  // 1 + s: true length over odometry's.
  std::size_t node_count = 0;
  std::size_t range_count = 0;  // Accepted ones at this rover.
  std::size_t rejected_range_count = 0;
  std::string text;  // What could not be determined; empty when nothing.
};

// One per usable range that had a part in the solve, in the order of CheckedGraph::ranges.
struct RangeVerdict {
  NodeKey from;
  NodeKey to;
  bool is_inlier = true;
  double residual_sigmas = 0;  // Signed: negative means that the measured range is too long.
};

struct Solution {
  bool is_accepted = false;
  SolveInitialValues initial_values = SolveInitialValues::kOdometry;
  std::string text;                  // Empty, or why the poses are the old ones, or what was left out. One line.
  std::map<NodeKey, Pose> poses;     // map_from_node of every usable node, base stations too.
  std::vector<RangeVerdict> ranges;  // Of the last stage; empty when not accepted.
  // Of SolverOptions::covariance_of those of rovers whose place in the map is known (not kYawFree, not kUnanchored): of
  // the position in the frame `map` (m), then of the turn in the node's own frame (rad). Also of nodes outside a
  // window. A base station's nodes have none, and an ambiguous rover's holds at the place where it was set down.
  std::map<NodeKey, Matrix6d> covariances;
  std::vector<RoverResult> rovers;  // By agent; empty when not accepted.
  LeftOutMap left_out;              // What was not usable.
  std::size_t node_count = 0;
  std::size_t odometry_count = 0;
  std::size_t range_count = 0;  // Usable ones.
  std::size_t rejected_range_count = 0;
  double initial_cost = 0;  // F over the accepted ranges where the solve began,
  double final_cost = 0;    // and where it ended.
  int iterations = 0;       // Of all stages.
};

Solution SolvePoseGraph(const PoseGraph& graph, const AgentFactsMap& agents, const LastSolution& last,
                        const SolverOptions& options);

// What to go on from after `solution`, which was accepted.
LastSolution ToLast(const Solution& solution);

}  // namespace moondb
