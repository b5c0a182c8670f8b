#include "actors/storage/map_budget.h"

#include <algorithm>

namespace moondb {

Result<std::uint64_t> UsedByRecords(Database& database, std::uint64_t history_bytes) {
  const Result<std::uint64_t> used = database.UsedPageBytes();
  if (!used) return used;
  const Result<std::int64_t> bundles = database.Number("SELECT coalesce(sum(length(file)), 0) FROM downlink_bundle");
  if (!bundles) return tl::unexpected(bundles.error());
  return *used - std::min(*used, static_cast<std::uint64_t>(*bundles) + history_bytes);
}

Result<void> CheckBudgetForOwnMaps(std::uint64_t used_bytes, std::uint64_t bytes_max) {
  if (used_bytes < bytes_max) return {};
  return Fail(ErrorCode::kFull,
              "the store's budget (retention.store_mb_max) is used up: no more maps are accepted, and the rest of the "
              "disk is reserved for states");
}

Result<void> CheckBudgetForOthersMaps(std::uint64_t used_bytes, std::uint64_t bytes_max) {
  if (static_cast<double>(used_bytes) <= kOthersMapsPartMax * static_cast<double>(bytes_max)) return {};
  return Fail(
      ErrorCode::kFull,
      "the store's budget (retention.store_mb_max) is nearly used up: no more maps of other agents are accepted, "
      "the rest is reserved for this agent's own maps");
}

}  // namespace moondb
