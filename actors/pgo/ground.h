// Whether the ground under a rover is level, as far as its own way shows.
#pragma once

#include <vector>

#include "actors/pgo/graph_check.h"

namespace moondb {

// Of each of `rovers`: whether its raw poses are never tilted by more than odometry's noise explains, so that their
// tilt is the bare sum of noisy steps and the ground counts as level. On level ground, over n disjoint spans of equally
// many steps, the mean of |tilt over the span|^2 / (its accumulated variance) is 1 with a deviation of 1 / sqrt(n); a
// rover is on slopes where it exceeds 2 + 12 / n for spans of 1, 2, 4, ... steps. So a hill counts that is gentler than
// the noise of a step but higher than the noise of the way over it. On slopes, too: who begins tilted by more than
// three `gravity_sigma_rad`, and who has no odometry.
//
// What it cannot see: a slope below that, and one whose changes stay below odometry's noise over every span.
std::vector<bool> FindLevelGround(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                  double gravity_sigma_rad);

}  // namespace moondb
