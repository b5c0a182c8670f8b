// MinimisePlanar: Levenberg-Marquardt in the plane with variable projection, which re-solves all positions after each
// step.
//
// In a long chain of poses, a step along the tangent of a rotation stretches the chain. Levenberg-Marquardt then takes
// thousands of small steps through a shallow valley of the cost in which distant poses must swing along. Re-solving the
// positions lets them swing along, so that the search is only over rotations (variable projection; Ruhe and Wedin,
// 1980). Re-solving is cheap, because its matrix is factorised only once. Near the minimum the exact second derivatives
// are used if they are positive definite. Along a shallow valley the Gauss-Newton approximation of the second
// derivatives is too large, and its steps are too short.
#pragma once

#include <functional>

#include "actors/pgo/planar_system.h"

namespace moondb {

struct PlanarDescentOptions {
  int iterations_max = 200;
  // Initial radius. The damping is the diagonal of the normal matrix divided by the radius.
  double trust_region_radius = 1e4;
  std::function<bool()> stop_requested = {};  // Polled once per iteration.
};

struct PlanarDescent {
  bool has_converged = false;
  double cost = 0;  // Final value of F. Not finite if the initial values have no finite cost.
  int iterations = 0;
};

PlanarDescent MinimisePlanar(PlanarSystem& system, const PlanarDescentOptions& options, PlanarState& state);

}  // namespace moondb
