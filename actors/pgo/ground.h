// Detects from a rover's trajectory whether the rover drives on level ground.
#pragma once

#include <vector>

#include "actors/pgo/graph_check.h"

namespace moondb {

// Returns, for each of `rovers`, whether the ground counts as level. Level ground means that the raw poses are never
// tilted by more than odometry noise explains.
//
// The test compares tilts over spans of 1, 2, 4, ... steps. Its statistic is the mean of |tilt over the span|^2 /
// (accumulated variance of the span) over n disjoint spans of equal length. On level ground the mean is 1, with a
// standard deviation of 1 / sqrt(n). If the mean exceeds 2 + 12 / n for any span length, the rover is on slopes. Long
// spans detect even a gentle hill whose slope is below the noise of one step. A rover also counts as on slopes if its
// first pose is tilted by more than three `gravity_sigma_rad`, or if it has no odometry.
//
// Not detected: a slope whose changes stay below the odometry noise over every span.
std::vector<bool> FindLevelGround(const CheckedGraph& graph, const std::vector<Rover>& rovers,
                                  double gravity_sigma_rad);

}  // namespace moondb
