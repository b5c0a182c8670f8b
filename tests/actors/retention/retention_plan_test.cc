#include "actors/retention/retention_plan.h"

#include <gtest/gtest.h>

#include "proto/status.pb.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr double kMb = 1e6;

proto::StorageStatus StatusOf(double used_mb, double map_mb) {
  proto::StorageStatus status;
  status.set_database_bytes((used_mb + 3) * kMb);
  status.set_wal_bytes(3 * kMb);
  status.set_map_bytes(map_mb * kMb);
  return status;
}

proto::RetentionConfig BudgetOf(double store_mb, double map_part) {
  proto::RetentionConfig retention;
  retention.set_store_mb_max(store_mb);
  retention.set_map_part_max(map_part);
  return retention;
}

const std::vector<DataType> kTypes = {
    proto::POWER,          proto::POSE_GRAPH_NODE, proto::OPTIMIZED_POSE,      proto::LOCAL_TRAVERSABILITY_MAP,
    proto::MAP_QUARANTINE, proto::AGENT_EVENT,     static_cast<DataType>(1000)};

TEST(RetentionPlanTest, HasNothingToDoWithoutLimits) {
  EXPECT_FALSE(HasLimits({}));
  EXPECT_TRUE(PlanOf({}, kTypes, StatusOf(1e6, 1e6)).empty());
}

TEST(RetentionPlanTest, RemovesAllTypesByAge) {
  proto::RetentionConfig retention;
  retention.set_keep_days(30);
  EXPECT_TRUE(HasLimits(retention));
  const PrunePlan plan = PlanOf(retention, kTypes, {});
  ASSERT_EQ(plan.size(), 1u);
  EXPECT_TRUE(plan[0].request.data_types().empty());
  EXPECT_EQ(plan[0].request.older_than_s(), 30 * 86400);
  EXPECT_EQ(plan[0].until_bytes, 0);
}

TEST(RetentionPlanTest, KeepsEventsByTheirOwnAgeIfOneIsSet) {
  proto::RetentionConfig retention;
  retention.set_keep_days(30);
  retention.set_keep_event_days(90);
  const PrunePlan plan = PlanOf(retention, kTypes, {});
  ASSERT_EQ(plan.size(), 2u);
  ASSERT_EQ(plan[0].request.data_types_size(), 1);
  EXPECT_EQ(plan[0].request.data_types(0), proto::AGENT_EVENT);
  EXPECT_EQ(plan[0].request.older_than_s(), 90 * 86400);
  const auto& others = plan[1].request.data_types();
  EXPECT_EQ(std::vector<DataType>(others.begin(), others.end()),
            (std::vector<DataType>{proto::POWER, proto::LOCAL_TRAVERSABILITY_MAP, static_cast<DataType>(1000)}));
}

TEST(RetentionPlanTest, RemovesNothingFromAStoreWithinItsBudget) {
  EXPECT_TRUE(HasLimits(BudgetOf(100, 0.7)));
  EXPECT_TRUE(PlanOf(BudgetOf(100, 0.7), kTypes, StatusOf(85, 85)).empty());
}

TEST(RetentionPlanTest, RemovesMapsBeyondTheirPartFirst) {
  const PrunePlan plan = PlanOf(BudgetOf(100, 0.5), kTypes, StatusOf(90, 45));
  ASSERT_EQ(plan.size(), 2u);
  ASSERT_EQ(plan[0].request.data_types_size(), 1);
  EXPECT_EQ(plan[0].request.data_types(0), proto::LOCAL_TRAVERSABILITY_MAP);
  EXPECT_NEAR(plan[0].until_bytes, 5 * kMb, 1);  // Maps use 45 MB, and their limit is 40 MB.
  EXPECT_TRUE(plan[1].request.data_types().empty());
  EXPECT_NEAR(plan[1].until_bytes, 10 * kMb, 1);
}

TEST(RetentionPlanTest, RemovesNoMoreMapsThanTheStoreExceedsItsBudget) {
  const PrunePlan plan = PlanOf(BudgetOf(100, 0.5), kTypes, StatusOf(86, 80));
  ASSERT_EQ(plan.size(), 2u);
  EXPECT_NEAR(plan[0].until_bytes, 6 * kMb, 1);
}

TEST(RetentionPlanTest, RemovesTheOldestOfAllTypesIfMapsAreWithinTheirPart) {
  const PrunePlan plan = PlanOf(BudgetOf(100, 0.5), kTypes, StatusOf(90, 10));
  ASSERT_EQ(plan.size(), 1u);
  EXPECT_TRUE(plan[0].request.data_types().empty());
}

TEST(RetentionPlanTest, RemovesFullyOccludedMapsFirstIfTheTeamFileSaysSo) {
  proto::RetentionConfig retention = BudgetOf(100, 0.5);
  retention.set_drop_occluded_maps(true);
  const PrunePlan plan = PlanOf(retention, kTypes, StatusOf(90, 45));
  ASSERT_EQ(plan.size(), 3u);
  EXPECT_TRUE(plan[0].is_of_occluded_maps);
  EXPECT_NEAR(plan[0].until_bytes, 10 * kMb, 1);
  EXPECT_TRUE(PlanOf(retention, kTypes, StatusOf(10, 5)).empty());
}

TEST(RetentionPlanTest, CarriesOutAnOperatorsOrder) {
  proto::PruneOrder order;
  order.set_is_dry_run(true);
  order.set_older_than_s(60);
  order.add_data_types(proto::POSE_GRAPH_EDGE);
  order.set_content_bytes_max(5);
  const PrunePlan plan = PlanOf(order, kTypes);
  ASSERT_EQ(plan.size(), 1u);
  EXPECT_TRUE(plan[0].request.is_dry_run());
  EXPECT_EQ(plan[0].request.older_than_s(), 60);
  EXPECT_EQ(plan[0].request.data_types_size(), 1);
  EXPECT_EQ(plan[0].until_bytes, 5);
  EXPECT_FALSE(plan[0].is_of_occluded_maps);
}

}  // namespace
}  // namespace moondb
