// Converts between g2o and PyFG.
//
// A g2o vertex has a 64-bit id and names no agent. Ids are written as GTSAM symbols: the highest byte is the letter of
// the robot, the lower bytes are the index of the node.
#pragma once

#include "model/error.h"
#include "model/g2o.h"
#include "model/pyfg.h"

namespace moondb {

// Converts poses, relative poses and priors. Omits ranges, because g2o has no edge for them. Returns kInvalid if the
// index of a node is 2^56 or more, or if a covariance is singular.
Result<G2o> ToG2o(const Pyfg& pyfg);

// Converts a g2o graph. Timestamps become 0. Assigns vertices whose ids are not GTSAM symbols to `plain_agent`, the
// alphabet position of a letter (AgentOfLetter). Returns kInvalid if `plain_agent` is 0 but is needed for a vertex, if
// an information matrix is singular, or if there is no vertex.
Result<Pyfg> ToPyfg(const G2o& g2o, AgentId plain_agent);

}  // namespace moondb
