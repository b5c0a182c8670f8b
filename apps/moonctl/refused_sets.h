// Describes measurements that a solve refused together.
#pragma once

#include <string>

#include "proto/graph.pb.h"

namespace moondb {

// Returns, for example, "152 loop closures of apriltag", "3 ranges" or "40 priors".
std::string RefusedCount(const proto::RefusedSet& set);

}  // namespace moondb
