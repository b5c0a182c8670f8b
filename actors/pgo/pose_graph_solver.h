// SolvePoseGraph: estimates all rovers' trajectories from odometry, ranges, loop closures and priors (paper, Section
// 5.2).
//
// The solver minimises the following cost over the poses x, each rover's odometry scale s and the bias b of each pair
// of radios:
//
//   F = 1/2 ( sum_odometry |r|^2 + sum_range |r|^2 + sum_closure |r|^2 + sum_prior |r|^2    actors/pgo/factors.h
//           + sum_rover |start prior|^2 + sum_node |gravity|^2 + sum (s / 2 %)^2 + sum (b / 0.1 m)^2 )
//
// The solve has these stages:
// 1. leave out unusable records (graph_check.h);
// 2. take initial values from the last solution (initial_values.h);
// 3. minimise with a Cauchy loss on ranges, loop closures and priors, because many of them are wrong;
// 4. reject ranges beyond 3.5 sigma, and loop closures and priors beyond a Mahalanobis distance of 4;
// 5. repeat least squares over the accepted factors and tests of all, until the verdicts no longer change;
// 6. refuse sets of loop closures or priors that contradict the ranges together (set_test.h).
//
// A warm solve (nearly all nodes have been solved before) starts from the last verdicts instead of stage 3, so an
// unchanged graph keeps its poses. If a warm solution is not accepted, or rejects most ranges of a rover, the graph is
// also solved from odometry, and the solution with the lower robust cost is used. A rover without a configured start is
// placed by its loop closures and priors (placement_by_poses.h), or by its ranges (unknown_starts.h).
//
// Deterministic: the same values in any order give the same solution, to the last bit for one thread count and binary.
// May run on any thread.
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
#include <utility>
#include <vector>

#include "actors/pgo/graph_check.h"
#include "model/pose_graph.h"

namespace moondb {

// Source of the up direction at a node. Raw poses from visual-inertial odometry observe gravity, so their roll and
// pitch are right on slopes too. In recordings made on a floor, raw poses are sums of noisy steps, and their tilt is
// meaningless. kLevelGround therefore assumes no tilt. kChosen decides for each rover from its own trajectory
// (ground.h).
enum class GravityReference { kChosen, kRawPoses, kLevelGround };

struct SolverOptions {
  int thread_count = 2;         // Number of Ceres threads; 1 in simulation.
  int iterations_max = 100;     // Maximum number of iterations per stage.
  double cauchy_sigmas = 2;     // Scale of the Cauchy loss of the robust stage.
  double huber_sigmas = 1.345;  // Scale of the Huber loss, used only for comparison.
  double reject_sigmas = 3.5;   // Ranges with larger residuals are left out of the last stage.
  double reject_distance = 4;   // Loop closures and priors with larger Mahalanobis distances are left out.
  // Replaces reject_sigmas for a range directly before or after a rejected range between the same two agents, if both
  // residuals have the same sign.
  double burst_sigmas = 2.5;
  double scale_sigma = 0.02;   // Standard deviation of a rover's odometry scale about 1.
  double bias_sigma_m = 0.10;  // Standard deviation, about 0, of the constant range error of a pair of agents.
  GravityReference gravity_reference = GravityReference::kChosen;
  double gravity_sigma_rad = 0.02;  // Standard deviation of roll and pitch about gravity_reference.
  double ambiguous_cost = 10;       // Two solutions whose robust F differs by less are considered ambiguous.
  // Limits of KeepStill (keep_still.h). A rigid motion above still_move_m or still_move_rad is undone if F then rises
  // by less than still_cost.
  double still_move_m = 0.01;
  double still_move_rad = 0.002;
  double still_cost = 0.25;
  // Standard deviations of the prior on the first pose of a rover that has no configured start and is not placed, and
  // on the first pose after a gap in the odometry.
  double loose_sigma_m = 10;
  double loose_sigma_rad = 1;
  // If not 0, only this many newest nodes of each rover, and all nodes without a previous solution, are variable. The
  // solve is then quick. Scales, biases and all other poses are held constant. Ignored if less than 80 % of the nodes
  // have been solved before, or if a rover without a configured start might belong elsewhere.
  std::size_t window_nodes = 0;
  // Nodes whose covariance is also computed. This takes about as long as a warm solve.
  std::vector<NodeKey> covariance_of = {};
  // Polled once per iteration. If it returns true, the solve ends and its solution is not accepted.
  std::function<bool()> stop_requested = {};
};

// The last published solution, from which a solve continues.
struct LastSolution {
  std::map<NodeKey, Pose> poses;  // map_from_node of each node.
  // Rejected ranges, loop closures and priors. All other ranges between nodes in `poses` were accepted.
  std::set<FactorKey> rejected;
  std::set<FactorKey> accepted;  // Accepted loop closures and priors.

  void AddVerdict(const FactorKey& factor, bool is_inlier);
};

// Loop closures of one source between two rovers, or priors of one source on one rover (set_test.h).
struct FactorSet {
  FactorKind kind = FactorKind::kLoopClosure;  // kLoopClosure or kPrior.
  AgentId producer = 0;                        // Agent that inserted the factors; 0 if unknown.
  std::pair<AgentId, AgentId> agents;          // The smaller id first. Both are equal within one rover.
  std::string source;
  std::vector<std::size_t> factors;  // Numbers of tested factors (graph_check.h).
};

enum class Anchoring {
  // The rover has accepted ranges or loop closures to agents in the map, or accepted priors. It has a configured start
  // or priors that determine its heading, or it is joined, directly or through other rovers, to such a rover or to two
  // base stations.
  kAnchored,
  // The rover has a configured start and odometry, but no accepted range, loop closure or prior that joins it to the
  // map.
  kNoRanges,
  // Ranges join the rover to one base station, and no start is known. The trajectories may be rotated about the base
  // station.
  kYawFree,
  kAmbiguous,   // Another place would fit the rover's ranges nearly as well.
  kUnanchored,  // Nothing ties the rover to the map. Only its relative poses are meaningful.
};

// The initial values from which the returned solution was computed.
enum class SolveInitialValues {
  kOdometry,        // Start poses and odometry.
  kLastSolution,    // The last solution, which contains at least 80 % of the free nodes.
  kArrangedRovers,  // Rovers without a known start were placed by their ranges, loop closures or priors.
};

// Returns "odometry", "warm" or "stage 0".
std::string ToString(SolveInitialValues initial_values);

struct RoverResult {
  AgentId agent = 0;
  Anchoring anchoring = Anchoring::kUnanchored;
  double odometry_scale = 1;  // 1 + s: the ratio of true length to odometry's length.
  std::size_t node_count = 0;
  std::size_t range_count = 0;  // Number of accepted ranges of this rover.
  std::size_t rejected_range_count = 0;
  std::string text;  // Describes problems with this rover's data or place. Empty if there are none.
};

struct FactorVerdict {
  FactorKey factor;
  bool is_inlier = true;
  // A range has a signed residual, negative if the measured range is too long. A loop closure or prior has a
  // Mahalanobis distance.
  double residual_sigmas = 0;
};

// Numbers of factors of one kind.
struct FactorCount {
  std::size_t usable = 0;
  std::size_t rejected = 0;

  std::size_t accepted() const { return usable - rejected; }
};

struct Solution {
  bool is_accepted = false;  // True if all numbers are finite, Ceres converged, and F did not increase.
  SolveInitialValues initial_values = SolveInitialValues::kOdometry;
  // Says why the solution is not accepted, or that there is nothing to solve. Otherwise empty.
  std::string text;
  std::map<NodeKey, Pose> poses;  // map_from_node of every usable node. The initial values if not accepted.
  // In the order of the tested factors (graph_check.h). Empty if the solution is not accepted.
  std::vector<FactorVerdict> verdicts;
  std::vector<FactorSet> refused;  // Sets of loop closures or priors that were refused together.
  // Covariances of the nodes in SolverOptions::covariance_of, including nodes outside a window. Rows are the position
  // in the frame `map` (m), then the rotation in the node's own frame (rad). Base stations, and rovers whose place in
  // the map is unknown (kYawFree, kUnanchored), have none. The covariance of an ambiguous rover is valid for the place
  // that the solve chose.
  std::map<NodeKey, Matrix6d> covariances;
  std::vector<RoverResult> rovers;  // Sorted by agent. Empty if the solution is not accepted.
  LeftOutMap left_out;              // Unusable nodes and edges.
  std::size_t node_count = 0;
  std::size_t odometry_count = 0;
  std::map<FactorKind, FactorCount> counts;  // Kinds without a usable factor are absent.
  double initial_cost = 0;                   // F over the accepted factors at the initial values.
  double final_cost = 0;                     // F over the accepted factors at the end of the solve.
  int iterations = 0;                        // Sum of the iterations of all stages.

  FactorCount CountOf(FactorKind kind) const {
    const auto found = counts.find(kind);
    return found == counts.end() ? FactorCount() : found->second;
  }
};

Solution SolvePoseGraph(const PoseGraph& graph, const AgentFactsMap& agents, const LastSolution& last,
                        const SolverOptions& options);

// Returns the solution in the form from which the next solve continues. Requires: `solution` was accepted.
LastSolution ToLast(const Solution& solution);

}  // namespace moondb
