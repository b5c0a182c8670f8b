// Between g2o and PyFG: which vertex is whose.
//
// g2o knows only ids of 64 bits. They are written, and read where they fit, as GTSAM's symbols: the letter of the robot
// in the highest byte, its own number of the node below. Plain functions.
#pragma once

#include "model/error.h"
#include "model/g2o.h"
#include "model/pyfg.h"

namespace moondb {

// Poses and steps; g2o has no edge for ranges. kInvalid: an index beyond 2^56, a covariance that has no inverse.
Result<G2o> ToG2o(const Pyfg& pyfg);

// `plain_agent`: whose letter (AgentOfLetter) vertices have whose id is no symbol; 0: there must be none. Stamps are 0.
// kInvalid: a vertex that is nobody's, an information that has no inverse, no vertex at all.
Result<Pyfg> ToPyfg(const G2o& g2o, AgentId plain_agent);

}  // namespace moondb
