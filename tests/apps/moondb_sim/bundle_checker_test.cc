#include "apps/moondb_sim/bundle_checker.h"

#include <gtest/gtest.h>

#include "actors/sharing/bundle_file.h"
#include "model/record_hash.h"
#include "model/record_key.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

constexpr StreamKey kBundlePowers{1, 5, proto::POWER};

proto::StoredRecord State(std::uint64_t seq) {
  proto::Record record;
  record.mutable_power()->set_battery_ratio(0.5);
  proto::StoredRecord stored;
  *stored.mutable_key() = ToProto(RecordKey{kBundlePowers, seq});
  stored.set_content(record.SerializeAsString());
  stored.set_hash(HashRecord({kBundlePowers, seq}, stored.content()));
  return stored;
}

// Returns a bundle file with one state.
std::string FileOf(std::uint32_t number, std::uint64_t seq) {
  proto::BundleFile head;
  head.set_team("test");
  head.set_agent_id(1);
  head.set_number(number);
  BundleWriter writer(head, kBundleBytesMax);
  proto::RecordBatch batch;
  *batch.add_records() = State(seq);
  EXPECT_EQ(writer.Add(batch), 1);
  return writer.Finish();
}

proto::DownlinkRequest Acknowledge(std::uint32_t number) {
  proto::DownlinkRequest request;
  request.set_acknowledge(number);
  return request;
}

class BundleCheckerTest : public testing::Test {
 protected:
  // Makes bundle `number` with state `seq`, and fetches the bundle.
  void Make(std::uint32_t number, std::uint64_t seq) {
    const std::string file = FileOf(number, seq);
    proto::DownlinkBundle& bundle = *waiting_.add_waiting();
    bundle.set_number(number);
    bundle.set_hash(HashOfBundle(file));
    proto::DownlinkReply reply = waiting_;
    *reply.mutable_made() = bundle;
    ASSERT_EQ(checker_.OnReply({}, reply, /*is_at_once=*/true), std::nullopt);
    ASSERT_EQ(checker_.OnFile(number, file), std::nullopt);
  }

  BundleChecker checker_;
  proto::DownlinkReply waiting_;
};

TEST_F(BundleCheckerTest, ABundleWaitsUntilItIsAcknowledged) {
  Make(1, 1);
  checker_.OnRestart();
  EXPECT_EQ(checker_.OnReply({}, waiting_, true), std::nullopt);
  EXPECT_TRUE(checker_.OutlivedProcess(1));
  checker_.OnAsked(Acknowledge(1));
  EXPECT_EQ(checker_.OnReply(Acknowledge(1), {}, true), std::nullopt);
  EXPECT_EQ(checker_.FetchedBundle(), 0u);
  EXPECT_NE(checker_.OnReply({}, waiting_, true), std::nullopt) << "it waits again";
  EXPECT_NE(checker_.OnNotFound(1), std::nullopt);
  EXPECT_EQ(checker_.OnNotFound(2), std::nullopt);
}

TEST_F(BundleCheckerTest, ReportsABundleThatVanishesOrIsMadeTwice) {
  Make(1, 1);
  EXPECT_NE(checker_.OnReply({}, {}, true), std::nullopt);
  EXPECT_EQ(checker_.OnReply({}, {}, false), std::nullopt) << "an answer that comes late";
  proto::DownlinkReply again = waiting_;
  *again.mutable_made() = again.waiting(0);
  EXPECT_NE(checker_.OnReply({}, again, true), std::nullopt);
  waiting_.mutable_waiting(0)->set_hash(7);
  EXPECT_NE(checker_.OnReply({}, waiting_, true), std::nullopt);
}

TEST_F(BundleCheckerTest, ARecordIsInOneBundle) {
  Make(1, 1);
  const std::string file = FileOf(2, 1);
  waiting_.add_waiting()->set_number(2);
  waiting_.mutable_waiting(1)->set_hash(HashOfBundle(file));
  ASSERT_EQ(checker_.OnReply({}, waiting_, true), std::nullopt);
  EXPECT_EQ(checker_.UnknownBundle(), 2u);
  const BundleChecker::Broken broken = checker_.OnFile(2, file);
  ASSERT_TRUE(broken);
  EXPECT_EQ(broken->first, "bundle_once");
  EXPECT_EQ(checker_.OnFile(1, file)->first, "bundle_kept") << "another file than was made";
}

TEST_F(BundleCheckerTest, RecordsInNoBundleAreLostUnlessTheDiskWasLost) {
  Make(1, 1);
  HaveSet wanted;
  wanted[kBundlePowers].held.Add(1);
  EXPECT_EQ(checker_.WhyLost(wanted), std::nullopt);
  wanted[kBundlePowers].held.Add(2);
  EXPECT_NE(checker_.WhyLost(wanted), std::nullopt);
  checker_.OnDiskLost();
  EXPECT_EQ(checker_.WhyLost(wanted), std::nullopt);
}

}  // namespace
}  // namespace moondb::simulation
