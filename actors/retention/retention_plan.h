// What an agent removes from its store and in which order, from the team file's `retention`, from how full the store
// is, or from an operator's order. Pure functions; what may go at all is StorageActor's to know
// (actors/storage/prune.h).
//
// The store's budget (store_mb_max, S) is split: maps may take map_part_max of it. When the store takes more than
// kBudgetHigh S, so much goes that kBudgetLow S is left, in this order:
//   1. maps that win no cell of the merged map, where drop_occluded_maps says so;
//   2. maps beyond their part of kBudgetLow S, oldest first;
//   3. anything, oldest first.
// So maps make room for themselves, and states, of which only the newest are kept, and the pose graph never go because
// of them. What the order leaves to chance is the difference between contents and pages: the next look corrects it.
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
  proto::PruneRequest request;       // Without `acknowledged`, and without content_bytes_max.
  bool is_of_occluded_maps = false;  // Among these only; MergeActor knows them.
  double until_bytes = 0;            // It ends when the plan's steps have removed so much in all; 0: no limit.
};

using PrunePlan = std::vector<PruneStep>;

// Whether there is anything to look after; else no store need be looked at.
bool HasLimits(const proto::RetentionConfig& retention);

// Of the limits; `team_types` are all that the team knows. Empty: none is reached that can be told from `status`;
// limits of age are always in it.
PrunePlan PlanOf(const proto::RetentionConfig& retention, const std::vector<DataType>& team_types,
                 const proto::StorageStatus& status);

// Of an operator.
PrunePlan PlanOf(const proto::PruneOrder& order, const std::vector<DataType>& team_types);

}  // namespace moondb
