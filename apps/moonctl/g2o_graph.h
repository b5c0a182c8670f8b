// Converts between g2o and PyFG, and maps g2o vertices to agents.
//
// A g2o vertex only has a 64-bit id. Ids are written as GTSAM symbols: the letter of the robot in the highest byte, the
// index of the node in the lower bytes. Ids that fit this form are read as symbols. Plain functions.
#pragma once

#include "model/error.h"
#include "model/g2o.h"
#include "model/pyfg.h"

namespace moondb {

// Converts poses and odometry. Omits ranges, because g2o has no edge for them. kInvalid if an index exceeds 2^56 or a
// covariance is singular.
Result<G2o> ToG2o(const Pyfg& pyfg);

// Converts a g2o graph; timestamps become 0. A vertex whose id is no symbol gets the letter `plain_agent`
// (AgentOfLetter); 0 rejects such vertices. kInvalid if a vertex has no agent, an information matrix is singular, or
// there is no vertex.
Result<Pyfg> ToPyfg(const G2o& g2o, AgentId plain_agent);

}  // namespace moondb
