// What storage and whoever plans its pruning both have to know.
#pragma once

#include "model/data_types.h"

namespace moondb {

inline constexpr double kPruneAgeMax_s = 1e9;  // 30 years.

// DataTypeRow::is_kept_unless_named; custom types are not.
inline bool IsKeptUnlessNamed(DataType type) {
  const DataTypeRow* row = FindDataType(type);
  return row != nullptr && row->is_kept_unless_named;
}

}  // namespace moondb
