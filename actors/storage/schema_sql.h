// The SQL statements of a store's schema, of this version and of those that this version migrates. Thread-safe.
//
// Tests compare the statements of each version with a golden file (tests/actors/storage/golden).
#pragma once

#include <string>

namespace moondb {

// Returns the statements that make an empty file a store of version kStoreVersion, without the header.
std::string SchemaSql();

// Version 6: power has a nullable battery_ratio, optimized_pose has is_unplaced, the tables of types under the policy
// `all` have an index by time, and the views show both columns and events of the kind "pruned".

// Returns the statements that turn a store of version 5 into one of version 6 and keep all rows.
std::string From5To6Sql();

// Returns the statements that turn an empty store of version 6 into one of version 5, to check a store of version 5.
std::string From6To5Sql();

}  // namespace moondb
