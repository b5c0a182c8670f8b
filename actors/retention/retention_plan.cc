#include "actors/retention/retention_plan.h"

#include <algorithm>

#include "model/data_types.h"
#include "model/prune_rules.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr double kDay_s = 86'400;
constexpr double kMegabyte = 1e6;

// Adds all types that storage prunes if `data_types` is empty, except events.
void AddTypesButEvents(const std::vector<DataType>& team_types, proto::PruneRequest& request) {
  for (const DataType type : team_types) {
    if (type != proto::AGENT_EVENT && !IsKeptUnlessNamed(type)) request.add_data_types(type);
  }
}

void AddAgeSteps(const proto::RetentionConfig& retention, const std::vector<DataType>& team_types, PrunePlan& plan) {
  if (retention.keep_event_days() > 0) {
    PruneStep& step = plan.emplace_back();
    step.request.add_data_types(proto::AGENT_EVENT);
    step.request.set_older_than_s(retention.keep_event_days() * kDay_s);
  }
  if (retention.keep_days() <= 0) return;
  PruneStep& step = plan.emplace_back();
  step.request.set_older_than_s(retention.keep_days() * kDay_s);
  // If `data_types` is empty, storage prunes events too.
  if (retention.keep_event_days() <= 0) return;
  AddTypesButEvents(team_types, step.request);
}

void AddSizeSteps(const proto::RetentionConfig& retention, const proto::StorageStatus& status, PrunePlan& plan) {
  const double budget = retention.store_mb_max() * kMegabyte;
  const double used = status.database_bytes() - status.wal_bytes();
  if (budget <= 0 || used <= kBudgetHigh * budget) return;
  const double to_free = used - kBudgetLow * budget;
  if (retention.drop_occluded_maps()) {
    PruneStep& occluded = plan.emplace_back();
    occluded.is_of_occluded_maps = true;
    occluded.until_bytes = to_free;
  }
  const double map_excess = status.map_bytes() - retention.map_part_max() * kBudgetLow * budget;
  if (map_excess > 0) {
    PruneStep& maps = plan.emplace_back();
    for (const DataTypeRow& row : DataTypeRows()) {
      if (row.is_bulky) maps.request.add_data_types(row.type);
    }
    maps.until_bytes = std::min(to_free, map_excess);
  }
  plan.emplace_back().until_bytes = to_free;
}

}  // namespace

bool HasLimits(const proto::RetentionConfig& retention) {
  return retention.keep_days() > 0 || retention.keep_event_days() > 0 || retention.store_mb_max() > 0;
}

PrunePlan PlanOf(const proto::RetentionConfig& retention, const std::vector<DataType>& team_types,
                 const proto::StorageStatus& status) {
  PrunePlan plan;
  AddAgeSteps(retention, team_types, plan);
  AddSizeSteps(retention, status, plan);
  return plan;
}

PrunePlan PlanOf(const proto::PruneOrder& order, const std::vector<DataType>& team_types) {
  PruneStep step;
  step.request.set_is_dry_run(order.is_dry_run());
  step.request.set_is_history(order.is_history());
  step.request.set_older_than_s(order.older_than_s());
  *step.request.mutable_data_types() = order.data_types();
  if (order.data_types().empty() && !order.is_history()) AddTypesButEvents(team_types, step.request);
  step.is_of_occluded_maps = order.occluded_maps();
  step.until_bytes = order.content_bytes_max();
  return {step};
}

}  // namespace moondb
