// Converts between g2o and PyFG, and maps g2o vertices to agents.
//
// A g2o vertex only has a 64-bit id. Ids are written as GTSAM symbols: the letter of the robot in the highest byte, the
// index of the node in the lower bytes. Ids that fit this form are read as symbols. Plain functions.
#pragma once

#include "model/error.h"
#include "model/g2o.h"
#include "model/pyfg.h"

namespace moondb {

// Converts poses and odometry; g2o has no edge for ranges. kInvalid: an index beyond 2^56, or a singular covariance.
Result<G2o> ToG2o(const Pyfg& pyfg);

// `plain_agent` is the letter (AgentOfLetter) for vertices whose id is no symbol; 0 rejects such vertices. Timestamps
// are set to 0. kInvalid: a vertex without an agent, a singular information matrix, or no vertex at all.
Result<Pyfg> ToPyfg(const G2o& g2o, AgentId plain_agent);

}  // namespace moondb
