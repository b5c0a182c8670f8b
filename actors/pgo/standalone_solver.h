// SolveStandaloneGraph: finds the least squares solution of a graph without a team, from initial values that the solver
// chooses.
//
// Without ranges the solver starts from the chordal relaxation (chordal.h), and also from odometry if the first start
// does not converge. With ranges F has many local minima, and no single initialisation works for every graph. The
// solver therefore runs several starts and keeps the lowest-cost solution. Each start arranges the parts that only
// ranges join (arrangement.h). Some starts begin with a short prefix of the poses in order of time, which is doubled
// until it contains all poses. The search ends as soon as two starts end at the same lowest cost in the same shape.
//
// May run on any thread. The same graph gives the same solution for one thread count and binary.
#pragma once

#include <string>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

enum class PlainInitialValues { kOdometry, kChordal, kArrangedParts, kPrefixGrowth, kVertices };

// Returns "odometry", "chordal", "stage 0", "prefix growth" or "vertices".
std::string ToString(PlainInitialValues initial_values);

struct PlainSolution {
  bool has_converged = false;
  // The reason if the solve did not converge, and everything that the graph does not determine: the relative poses of
  // unconnected parts, or which of several shapes of equal cost is right. Empty if there is nothing to report.
  std::string text;
  std::vector<Pose> poses;  // In the order of StandaloneGraph::nodes. The file's vertices if no start gave a solution.
  double cost = 0;          // F; infinity if no start gave a solution.
  PlainInitialValues initial_values = PlainInitialValues::kOdometry;
  // Number of starts, and how many of them ended at the lowest cost in the same shape.
  int starts = 0;
  int starts_at_lowest = 0;
  int iterations = 0;  // Sum of the iterations of all starts.
};

PlainSolution SolveStandaloneGraph(const StandaloneGraph& graph, const PlainOptions& options);

// Solves by least squares, starting from poses composed along the odometry. Each connected component of the graph is
// placed by its first fixed node, or at the origin if it has none. For comparison with SolveStandaloneGraph.
PlainSolution SolveFromOdometry(const StandaloneGraph& graph, const PlainOptions& options);

// Solves by least squares from the poses in the file (PlainNode::vertex).
PlainSolution SolveFromVertices(const StandaloneGraph& graph, const PlainOptions& options);

}  // namespace moondb
