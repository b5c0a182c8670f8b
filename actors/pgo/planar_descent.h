// MinimisePlanar: Levenberg-Marquardt in the plane, with all positions settled after each step.
//
// In a long chain of poses a step along the tangent lengthens what it turns, so that a valley in which far poses must
// swing is walked in thousands of small steps. Settled positions swing along, which makes the search one over the turns
// (variable projection; Ruhe and Wedin, 1980) at the price of one solve with a factorisation that is made once. Near
// the minimum the second derivatives are the exact ones wherever they are positive definite: along a shallow valley
// those of Gauss and Newton are too large, and their steps too short.
#pragma once

#include <functional>

#include "actors/pgo/planar_system.h"

namespace moondb {

struct PlanarDescentOptions {
  int iterations_max = 200;
  double trust_region_radius = 1e4;           // At first; the damping is the normal matrix's diagonal over it.
  std::function<bool()> stop_requested = {};  // Polled once per iteration.
};

struct PlanarDescent {
  bool has_converged = false;
  double cost = 0;  // F where it ended; not finite where the start has none.
  int iterations = 0;
};

PlanarDescent MinimisePlanar(PlanarSystem& system, const PlanarDescentOptions& options, PlanarState& state);

}  // namespace moondb
