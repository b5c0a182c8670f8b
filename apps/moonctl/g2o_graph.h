// Converts between g2o and PyFG.
//
// Ids are written as GTSAM Symbols, and read in all layouts of model/g2o_id.h.
#pragma once

#include "model/error.h"
#include "model/g2o.h"
#include "model/pyfg.h"

namespace moondb {

// Converts poses, relative poses and priors. Omits ranges, because g2o has no edge for them. Returns kInvalid if the
// index of a node is above kSymbolIndexMax, or if a covariance is singular.
Result<G2o> ToG2o(const Pyfg& pyfg);

// Converts a g2o graph. Timestamps become 0. Assigns plain ids to `plain_agent`, the alphabet position of a letter
// (AgentOfLetter). Returns kInvalid for a plain id if `plain_agent` is 0, for an id of another layout, and for two ids
// of one node. Also returns kInvalid if an information matrix is singular, or if there is no vertex.
Result<Pyfg> ToPyfg(const G2o& g2o, AgentId plain_agent);

}  // namespace moondb
