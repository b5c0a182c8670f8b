#include "apps/moondb_sim/lease_watch.h"

#include <gtest/gtest.h>

#include "actors/sharing/codec.h"
#include "model/record_key.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

using std::chrono::seconds;

constexpr MonotonicTime kStart(seconds(1000));
constexpr AgentId kSelf = 1;
constexpr AgentId kOther = 2;

proto::Message Lease(proto::LeaseKind kind, double lease_s) {
  proto::Message message;
  message.set_hop_sender(kSelf);
  message.mutable_lease_request()->set_kind(kind);
  message.mutable_lease_request()->set_seconds(lease_s);
  return message;
}

proto::Message Announcement(std::uint64_t number, double driving_s, double sleeping_s, double paused_s = 0) {
  proto::Message message;
  message.set_hop_sender(kOther);
  message.mutable_lease_announce()->set_number(number);
  message.mutable_lease_announce()->set_driving_s(driving_s);
  message.mutable_lease_announce()->set_sleeping_s(sleeping_s);
  message.mutable_lease_announce()->set_paused_s(paused_s);
  return message;
}

proto::Message Hello() {
  proto::Message message;
  message.mutable_hello();
  return message;
}

proto::Message Batch(DataType type, std::uint64_t remaining) {
  proto::RecordBatch records;
  *records.add_records()->mutable_key() = ToProto(RecordKey{{kSelf, 7, type}, 1});
  CodedBatch coded = EncodeBatch(records);
  proto::Message message;
  message.set_remaining(remaining);
  message.mutable_batch()->set_codec(coded.codec);
  message.mutable_batch()->set_coded(std::move(coded.bytes));
  message.mutable_batch()->set_record_count(1);
  return message;
}

class LeaseWatchTest : public testing::Test {
 protected:
  LeaseWatchTest() { TellSync(-1); }

  void TellLease(const proto::Message& message, double at_s = 0) {
    watch_.OnHandle(actor_name::kLease, message, At(at_s));
  }
  void TellSync(double at_s) {
    proto::Message message;
    message.mutable_leases_changed();
    watch_.OnHandle(actor_name::kSync, message, At(at_s));
  }
  bool MayBeSent(const proto::Message& message, double at_s) const {
    return !watch_.WhyQuiet(actor_name::kSync, kOther, message, At(at_s));
  }
  static MonotonicTime At(double at_s) {
    return kStart + std::chrono::duration_cast<Duration>(std::chrono::duration<double>(at_s));
  }

  LeaseWatch watch_{kSelf};
};

TEST_F(LeaseWatchTest, WhoSleepsSendsNothing) {
  EXPECT_TRUE(MayBeSent(Hello(), 1));
  TellLease(Lease(proto::LEASE_KIND_SLEEPING, 60));
  EXPECT_TRUE(MayBeSent(Hello(), 0)) << "in the same instant";
  EXPECT_FALSE(MayBeSent(Hello(), 1));
  EXPECT_FALSE(MayBeSent(Batch(proto::POWER, 9), 59));
  EXPECT_TRUE(MayBeSent(proto::Message(), 30)) << "control messages pass";
  EXPECT_TRUE(MayBeSent(Hello(), 60));
}

TEST_F(LeaseWatchTest, WhoDrivesSendsStatesAlone) {
  TellLease(Lease(proto::LEASE_KIND_DRIVING, 60));
  EXPECT_TRUE(MayBeSent(Hello(), 1));
  EXPECT_TRUE(MayBeSent(Batch(proto::POWER, 1), 1));
  EXPECT_FALSE(MayBeSent(Batch(proto::POWER, 0), 1)) << "the end of an order";
  EXPECT_FALSE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 1));
  EXPECT_TRUE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 60));
}

TEST_F(LeaseWatchTest, WhoIsPausedSendsAndIsSentStatesAloneAndIsNotSilent) {
  TellLease(Lease(proto::LEASE_KIND_PAUSED, 60));
  TellLease(Announcement(5, 0, 0, 100));
  EXPECT_TRUE(MayBeSent(Hello(), 1));
  EXPECT_TRUE(MayBeSent(Batch(proto::POWER, 1), 1));
  EXPECT_FALSE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 1));
  EXPECT_FALSE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 61)) << "the other one";
  EXPECT_TRUE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 101));
  EXPECT_EQ(watch_.LastQuiet(kSelf, At(30)), MonotonicTime::min());
  EXPECT_EQ(watch_.LastQuiet(kOther, At(30)), MonotonicTime::min());
}

TEST_F(LeaseWatchTest, WhoSleepsIsSentNothing) {
  TellLease(Announcement(5, 0, 60));
  EXPECT_FALSE(MayBeSent(Hello(), 1));
  EXPECT_FALSE(watch_.WhyQuiet(actor_name::kSync, 3, Hello(), At(1)).has_value()) << "another agent";
}

TEST_F(LeaseWatchTest, TheLastAnnouncementStands) {
  TellLease(Announcement(5, 0, 60));
  TellLease(Announcement(5, 0, 60), 30);
  EXPECT_TRUE(MayBeSent(Hello(), 61)) << "told again, it is the same lease";
  TellLease(Announcement(7, 0, 0), 70);
  TellLease(Announcement(6, 0, 60), 71);
  EXPECT_TRUE(MayBeSent(Hello(), 72)) << "late";
  TellLease(Announcement(std::uint64_t{1} << 40, 0, 60), 80);
  EXPECT_FALSE(MayBeSent(Hello(), 81)) << "of another life";
}

TEST_F(LeaseWatchTest, LeaseEndsByTheRobotsWord) {
  TellLease(Lease(proto::LEASE_KIND_DRIVING, 60));
  TellLease(Lease(proto::LEASE_KIND_DRIVING, 0), 10);
  EXPECT_TRUE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 11));
  EXPECT_EQ(watch_.LastQuiet(kSelf, At(30)), At(10));
}

TEST_F(LeaseWatchTest, ActorThatIsMadeAnewAsksFirst) {
  TellLease(Lease(proto::LEASE_KIND_SLEEPING, 60));
  watch_.OnFailure(actor_name::kSync);
  EXPECT_TRUE(MayBeSent(Hello(), 10));
  TellSync(10);
  EXPECT_TRUE(MayBeSent(Hello(), 10)) << "in the same instant";
  EXPECT_FALSE(MayBeSent(Hello(), 11));
  watch_.OnFailure(actor_name::kLease);
  EXPECT_TRUE(MayBeSent(Hello(), 11)) << "nobody knows any more";
}

TEST_F(LeaseWatchTest, KnowsWhenAnAgentWasQuietLast) {
  EXPECT_EQ(watch_.LastQuiet(kOther, At(10)), MonotonicTime::min());
  TellLease(Announcement(5, 20, 40));
  EXPECT_EQ(watch_.LastQuiet(kOther, At(10)), At(10));
  EXPECT_EQ(watch_.LastQuiet(kOther, At(100)), At(40));
  TellLease(Announcement(6, 0, 0), 30);
  EXPECT_EQ(watch_.LastQuiet(kOther, At(100)), At(30));
}

}  // namespace
}  // namespace moondb::simulation
