#include "apps/moondb_sim/disk_damage.h"

#include <gtest/gtest.h>

#include "actors/storage/have_ledger.h"
#include "actors/storage/record_store.h"
#include "actors/storage/storage_actor.h"
#include "apps/moondb_sim/simulated_disk.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

constexpr char kPath[] = "a/moondb.sqlite";
constexpr int kStates = 3;
constexpr int kNodes = 20;

class DiskDamageTest : public testing::TestWithParam<std::uint64_t> {
 protected:
  DiskDamageTest() : disk_(GetParam()), rng_(GetParam()) {
    const auto store = Open();
    for (int i = 0; i < kNodes; ++i) {
      proto::InsertRequest request;
      if (i < kStates) request.add_records()->mutable_power()->set_battery_ratio(0.1 * i);
      proto::PoseGraphNode& node = *request.add_records()->mutable_pose_graph_node();
      node.mutable_node()->set_agent_id(1);
      node.mutable_node()->set_index(static_cast<std::uint64_t>(i));
      node.mutable_map_from_node()->mutable_position_m();
      node.mutable_map_from_node()->mutable_orientation()->set_w(1);
      const RecordStore::Inserted inserted = store->Insert(request);
      EXPECT_FALSE(IsError(inserted.reply.error())) << inserted.reply.error().text();
    }
    covered_ = *FromProto(store->GetHave().have());
  }

  std::unique_ptr<RecordStore> Open() {
    RecordStore::Options options;
    options.path = kPath;
    options.vfs = disk_.name();
    options.self = 1;
    options.team = {1, 2};
    options.policies = {{proto::POWER, proto::POLICY_LATEST}, {proto::POSE_GRAPH_NODE, proto::POLICY_ALL}};
    return *RecordStore::Open(options);
  }

  SimulatedDisk disk_;
  std::mt19937_64 rng_;
  HaveSet covered_;
};

TEST_P(DiskDamageTest, RecordIsLostAloneWhenTheStoreIsOpened) {
  const std::optional<RecordKey> damaged = DamageRecord(**Database::Open(kPath, 0, disk_.name()), rng_);
  ASSERT_TRUE(damaged);
  EXPECT_TRUE(covered_.Get(damaged->stream).held.Contains(damaged->seq));
  const HaveSet have = *FromProto(Open()->GetHave().have());
  for (const auto& [stream, covered] : covered_.streams()) {
    IntervalSet expected = covered.held;
    if (stream == damaged->stream) expected.Remove(damaged->seq);
    EXPECT_EQ(have.Get(stream).held, expected) << ToString(*damaged);
  }
}

TEST_P(DiskDamageTest, IntervalCostsNoRow) {
  const std::optional<DamagedInterval> damaged = DamageInterval(**Database::Open(kPath, 0, disk_.name()), rng_);
  ASSERT_TRUE(damaged);
  const HaveSet have = *FromProto(Open()->GetHave().have());
  for (const auto& [stream, covered] : covered_.streams()) EXPECT_EQ(have.Get(stream).held, covered.held);
}

TEST_P(DiskDamageTest, EmptyStoreHasNothingToDamage) {
  disk_.Wipe("a/");
  (void)Open();
  const auto database = *Database::Open(kPath, 0, disk_.name());
  EXPECT_FALSE(DamageRecord(*database, rng_));
  EXPECT_FALSE(DamageInterval(*database, rng_));
}

INSTANTIATE_TEST_SUITE_P(Seeds, DiskDamageTest, testing::Range(std::uint64_t{1}, std::uint64_t{31}));

}  // namespace
}  // namespace moondb::simulation
