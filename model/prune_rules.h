// Pruning rules shared by storage and the actors that plan pruning.
#pragma once

#include "model/data_types.h"

namespace moondb {

inline constexpr double kPruneAgeMax_s = 1e9;  // Largest age in an order to prune: about 32 years.

// Returns whether records of the type are pruned only if an order names the type (DataTypeRow::is_kept_unless_named);
// false for custom types.
inline bool IsKeptUnlessNamed(DataType type) {
  const DataTypeRow* row = FindDataType(type);
  return row != nullptr && row->is_kept_unless_named;
}

}  // namespace moondb
