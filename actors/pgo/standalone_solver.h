// SolveStandaloneGraph: finds the least squares solution of a graph without a team, from initial values that it
// chooses.
//
// Without ranges the solver starts from the chordal relaxation (chordal.h). If that start does not converge, it starts
// from odometry as well.
//
// With ranges F has many local minima, and no single initialisation works for every graph. The solver therefore runs
// several starts and keeps the lowest-cost solution. Parts joined only by ranges are arranged first (arrangement.h),
// over the whole time and over short prefixes of the time. A prefix is then doubled until it covers the whole time, and
// each solve starts from the solution of the previous prefix. The search ends as soon as two different starts end at
// the same lowest cost in the same shape. If no two starts agree, the solver tries other poses for each part of the
// lowest-cost solution in turn.
//
// A pure function of its arguments; may run on any thread. The same graph gives the same solution for one thread count
// and binary.
#pragma once

#include <string>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

enum class InitialValues { kOdometry, kChordal, kArrangedParts, kPrefixGrowth, kVertices };

// Returns "odometry", "chordal", "stage 0", "prefix growth" or "vertices".
std::string ToString(InitialValues initial_values);

struct PlainSolution {
  bool has_converged = false;
  // The reason if the solve did not converge, and everything that the graph does not determine: the relative poses of
  // unconnected parts, or which of several shapes of equal cost is right. Empty if there is nothing to report.
  std::string text;
  std::vector<Pose> poses;  // In the order of StandaloneGraph::nodes. The file's vertices if no start gave a solution.
  double cost = 0;          // F; infinity if no start gave a solution.
  InitialValues initial_values = InitialValues::kOdometry;
  // Number of starts. starts_at_lowest: number of those starts that ended at the lowest cost, in one shape.
  int starts = 0;
  int starts_at_lowest = 0;
  int iterations = 0;  // Sum of the iterations of all starts.
};

PlainSolution SolveStandaloneGraph(const StandaloneGraph& graph, const PlainOptions& options);

// Solves by least squares from composed odometry, with each unconnected part at the origin. Serves as a comparison: it
// shows the result if initial values are not chosen.
PlainSolution SolveFromOdometry(const StandaloneGraph& graph, const PlainOptions& options);

// Returns the minimum that is found from PlainNode::vertex. For files whose vertices are good initial values.
PlainSolution SolveFromVertices(const StandaloneGraph& graph, const PlainOptions& options);

}  // namespace moondb
