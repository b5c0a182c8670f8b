// Names of pose-graph nodes on the command line: "rover2:17" is node 17 of rover2.
#pragma once

#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

std::string NodeName(const proto::TeamConfig& team, const NodeKey& node);

// Returns the node of this name. Fails with kInvalid and the field `option` for other text.
Result<NodeKey> ParseNodeName(const proto::TeamConfig& team, const std::string& text, const std::string& option);

}  // namespace moondb
