// SolveStandaloneGraph: the least squares solution of a graph by itself, with the beginning chosen by itself.
//
// Without ranges it begins at the chordal relaxation (chordal.h), and at odometry too where that does not converge.
// With ranges F has many minima, and no beginning is right always; so several roads are gone, and the lowest end
// counts: parts that only ranges join are arranged first (arrangement.h), over the whole time and over short prefixes
// of it, which then grow twice as long again and again, each solved from the last. The search ends early when two roads
// that began differently end at the same lowest cost in the same shape; where no two do, each part of the lowest one is
// set down elsewhere in turn.
//
// A pure function of its arguments, on any thread; the same graph gives the same solution for one thread count and
// binary.
#pragma once

#include <string>
#include <vector>

#include "actors/pgo/standalone_cost.h"
#include "actors/pgo/standalone_graph.h"

namespace moondb {

enum class InitialValues { kOdometry, kChordal, kArrangedParts, kPrefixGrowth, kVertices };

// "odometry", "chordal", "stage 0", "prefix growth", "vertices".
std::string ToString(InitialValues initial_values);

struct PlainSolution {
  bool has_converged = false;
  // Why not, and what could not be determined: how parts stand to each other that nothing joins; which of several
  // shapes of equal cost it is. Empty: nothing to say.
  std::string text;
  std::vector<Pose> poses;  // Of StandaloneGraph::nodes; its vertices where no road led anywhere.
  double cost = 0;          // F; infinity where no road led anywhere.
  InitialValues initial_values = InitialValues::kOdometry;
  int starts = 0;  // Gone; and how many of them ended at the lowest cost in one shape.
  int starts_at_lowest = 0;
  int iterations = 0;  // Of all roads.
};

PlainSolution SolveStandaloneGraph(const StandaloneGraph& graph, const PlainOptions& options);

// Least squares from composed odometry, parts that nothing joins each at the origin: what one gets without a choice of
// the beginning. For comparison.
PlainSolution SolveFromOdometry(const StandaloneGraph& graph, const PlainOptions& options);

// The minimum next to PlainNode::vertex, for who knows that a file's vertices are a good beginning.
PlainSolution SolveFromVertices(const StandaloneGraph& graph, const PlainOptions& options);

}  // namespace moondb
