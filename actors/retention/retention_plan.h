// Plans what an agent prunes and in which order. The input is an operator's order, or the `retention` section of the
// team file together with the fill level of the store. StorageActor decides which records may be removed at all
// (actors/storage/prune.h).
//
// Maps may take map_part_max of the store's budget S (store_mb_max). A store that exceeds kBudgetHigh * S is pruned
// down to kBudgetLow * S, in this order:
//   1. maps that win no cell of the merged map, if drop_occluded_maps is set;
//   2. maps beyond map_part_max * kBudgetLow * S, oldest first;
//   3. records of any type, oldest first.
//
// The sizes of contents and of file pages differ a little; the next check corrects the difference.
#pragma once

#include <vector>

#include "model/ids.h"
#include "proto/retention.pb.h"
#include "proto/team.pb.h"

namespace moondb::proto {
class StorageStatus;
}  // namespace moondb::proto

namespace moondb {

inline constexpr double kBudgetHigh = 0.85;
inline constexpr double kBudgetLow = 0.80;

struct PruneStep {
  // The request for storage. RetentionActor adds `acknowledged` and content_bytes_max.
  proto::PruneRequest request;
  // If true, the step removes only fully occluded maps, which MergeActor lists.
  bool is_of_occluded_maps = false;
  // The step ends when this step and all earlier steps of the plan together have removed this many bytes; 0: no limit.
  double until_bytes = 0;
};

using PrunePlan = std::vector<PruneStep>;

// Returns true if the team file sets any limit.
bool HasLimits(const proto::RetentionConfig& retention);

// Returns the plan for the limits of the team file. `team_types` are all data types of the team. Steps for age limits
// are always included. Steps for size limits are included if `status` exceeds them.
PrunePlan PlanOf(const proto::RetentionConfig& retention, const std::vector<DataType>& team_types,
                 const proto::StorageStatus& status);

// Returns the plan for an operator's order: one step.
PrunePlan PlanOf(const proto::PruneOrder& order, const std::vector<DataType>& team_types);

}  // namespace moondb
