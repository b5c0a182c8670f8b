// MinimisePlanar: Levenberg-Marquardt in the plane with variable projection (Ruhe and Wedin, 1980): after each step,
// all positions are solved again for the new rotations.
//
// In a long chain of poses, one rotation must move all later poses. Without variable projection, Levenberg-Marquardt
// then takes thousands of small steps. Solving the positions again is cheap, because the matrix is factorised only
// once. Near the minimum the exact second derivatives are used if they are positive definite, because Gauss-Newton
// steps are too short along a shallow valley of the cost.
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
