// The size limit of a store (retention.store_mb_max), as it applies to maps: beyond it a store refuses maps, to leave
// room for states and the pose graph. Other agents' maps are refused earlier than own ones.
#pragma once

#include <cstdint>

#include "actors/storage/sqlite_database.h"
#include "model/error.h"

namespace moondb {

// Part of the limit beyond which an agent that neither leads nor survives accepts no maps of other agents.
inline constexpr double kOthersMapsPartMax = 0.9;

// Returns the bytes of the file's used pages, without bundles and history, which have limits of their own.
Result<std::uint64_t> UsedByRecords(Database& database, std::uint64_t history_bytes);

// Fail with kFull if `used_bytes` leaves no room for maps. `bytes_max` is the limit.
Result<void> CheckBudgetForOwnMaps(std::uint64_t used_bytes, std::uint64_t bytes_max);
Result<void> CheckBudgetForOthersMaps(std::uint64_t used_bytes, std::uint64_t bytes_max);

}  // namespace moondb
