#include "apps/moondb_sim/state_checker.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

proto::Record Power(double ratio) {
  proto::Record record;
  record.mutable_power()->set_battery_ratio(ratio);
  return record;
}

proto::Record Beacon(const std::string& key, const std::string& payload) {
  proto::Record record;
  record.mutable_custom()->set_data_type(kBeacon);
  record.mutable_custom()->set_latest_key(key);
  record.mutable_custom()->set_payload(payload);
  return record;
}

RecordKey Key(std::uint64_t epoch, DataType type, std::uint64_t seq = 1) { return {{1, epoch, type}, seq}; }

class StateCheckerTest : public testing::Test {
 protected:
  // Agent 1 inserts the record, and then holds it under `key`.
  void Give(const RecordKey& key, const proto::Record& record) {
    checker_.OnGiven(1, record);
    Hold(1, key, record);
  }
  void Hold(AgentId agent, const RecordKey& key, const proto::Record& record) {
    checker_.OnContent(key, ContentHash(record.SerializeAsString()));
    checker_.OnHeld(agent, key);
  }
  bool IsOld(const RecordKey& key, const proto::Record& record) {
    return checker_.WhyOld(2, 0, {{key, record.SerializeAsString()}}).has_value();
  }

  StateChecker checker_;
};

TEST_F(StateCheckerTest, ReportsALostLatestStateRegardlessOfItsKey) {
  Give(Key(9, proto::POWER), Power(0.1));
  Give(Key(1, proto::POWER), Power(0.2));
  EXPECT_TRUE(IsOld(Key(9, proto::POWER), Power(0.1)));
  EXPECT_FALSE(IsOld(Key(1, proto::POWER), Power(0.2)));
  EXPECT_FALSE(IsOld(Key(10, proto::POWER), Power(0.2))) << "stored once more";
  EXPECT_TRUE(checker_.WhyOld(2, 0, {}).has_value());
  EXPECT_FALSE(checker_.WhyOld(3, 3, {}).has_value()) << "of the third's own states";
  checker_.OnGiven(1, Power(0.3));  // Storage has not answered yet, but may already hold this state.
  EXPECT_FALSE(IsOld(Key(1, proto::POWER), Power(0.2)));
  EXPECT_FALSE(IsOld(Key(1, proto::POWER, 2), Power(0.3)));
}

// An old disk is put back: what it never shared ranks above its replacement's states, what it shared does not.
TEST_F(StateCheckerTest, AllowsAStateThatAnOldDiskNeverShared) {
  Give(Key(1, proto::POWER, 1), Power(0.1));
  Hold(2, Key(1, proto::POWER, 1), Power(0.1));
  Give(Key(1, proto::POWER, 2), Power(0.2));
  Give(Key(2, proto::POWER), Power(0.3));
  Hold(2, Key(2, proto::POWER), Power(0.3));
  EXPECT_TRUE(IsOld(Key(3, proto::POWER), Power(0.2)));
  checker_.OnDiskReplaced(1);
  EXPECT_FALSE(IsOld(Key(3, proto::POWER), Power(0.2)));
  EXPECT_TRUE(IsOld(Key(3, proto::POWER), Power(0.1))) << "agent 2 had it";
  Give(Key(4, proto::POWER), Power(0.4));
  EXPECT_TRUE(IsOld(Key(3, proto::POWER), Power(0.2))) << "given after the disk was put back";
}

TEST_F(StateCheckerTest, IgnoresStatesThatWereLostWithAllDisks) {
  Give(Key(1, proto::POWER, 1), Power(0.1));
  Hold(2, Key(1, proto::POWER, 1), Power(0.1));
  Give(Key(1, proto::POWER, 2), Power(0.2));
  checker_.ForgetDisk(1);
  EXPECT_FALSE(IsOld(Key(1, proto::POWER, 1), Power(0.1)));
  EXPECT_TRUE(checker_.WhyOld(2, 0, {}).has_value());
}

TEST_F(StateCheckerTest, KnowsTypesKeysAndMarkedStatesApart) {
  Give(Key(1, kBeacon, 1), Beacon("a", "1"));
  Give(Key(1, kBeacon, 2), Beacon("b", "2"));
  proto::Record marked = Beacon("a", "1");
  marked.set_is_clock_suspect(true);
  const std::string b = Beacon("b", "2").SerializeAsString();
  EXPECT_TRUE(checker_.WhyOld(2, 0, {{Key(1, kBeacon, 2), b}}).has_value());
  const Records both = {{Key(1, kBeacon, 1), marked.SerializeAsString()}, {Key(1, kBeacon, 2), b}};
  EXPECT_FALSE(checker_.WhyOld(2, 0, both).has_value());
}

}  // namespace
}  // namespace moondb::simulation
