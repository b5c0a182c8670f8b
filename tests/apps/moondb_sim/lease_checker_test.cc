#include "apps/moondb_sim/lease_checker.h"

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

class LeaseCheckerTest : public testing::Test {
 protected:
  LeaseCheckerTest() { ReportSync(-1); }

  void ReportLease(const proto::Message& message, double at_s = 0) {
    checker_.OnHandle(actor_name::kLease, message, At(at_s));
  }
  void ReportSync(double at_s) {
    proto::Message message;
    message.mutable_leases_changed();
    checker_.OnHandle(actor_name::kSync, message, At(at_s));
  }
  bool MayBeSent(const proto::Message& message, double at_s) const {
    return !checker_.WhyQuiet(actor_name::kSync, kOther, message, At(at_s));
  }
  static MonotonicTime At(double at_s) {
    return kStart + std::chrono::duration_cast<Duration>(std::chrono::duration<double>(at_s));
  }

  LeaseChecker checker_{kSelf};
};

TEST_F(LeaseCheckerTest, ASleepingAgentSendsNothing) {
  EXPECT_TRUE(MayBeSent(Hello(), 1));
  ReportLease(Lease(proto::LEASE_KIND_SLEEPING, 60));
  EXPECT_TRUE(MayBeSent(Hello(), 0)) << "in the same instant";
  EXPECT_FALSE(MayBeSent(Hello(), 1));
  EXPECT_FALSE(MayBeSent(Batch(proto::POWER, 9), 59));
  EXPECT_TRUE(MayBeSent(proto::Message(), 30)) << "control messages pass";
  EXPECT_TRUE(MayBeSent(Hello(), 60));
}

TEST_F(LeaseCheckerTest, ADrivingAgentSendsOnlyStates) {
  ReportLease(Lease(proto::LEASE_KIND_DRIVING, 60));
  EXPECT_TRUE(MayBeSent(Hello(), 1));
  EXPECT_TRUE(MayBeSent(Batch(proto::POWER, 1), 1));
  EXPECT_FALSE(MayBeSent(Batch(proto::POWER, 0), 1)) << "the end of an order";
  EXPECT_FALSE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 1));
  EXPECT_TRUE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 60));
}

TEST_F(LeaseCheckerTest, APausedAgentExchangesOnlyStatesAndIsNotSilent) {
  ReportLease(Lease(proto::LEASE_KIND_PAUSED, 60));
  ReportLease(Announcement(5, 0, 0, 100));
  EXPECT_TRUE(MayBeSent(Hello(), 1));
  EXPECT_TRUE(MayBeSent(Batch(proto::POWER, 1), 1));
  EXPECT_FALSE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 1));
  EXPECT_FALSE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 61)) << "the other one";
  EXPECT_TRUE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 101));
  EXPECT_EQ(checker_.LastQuiet(kSelf, At(30)), MonotonicTime::min());
  EXPECT_EQ(checker_.LastQuiet(kOther, At(30)), MonotonicTime::min());
}

TEST_F(LeaseCheckerTest, ASleepingAgentReceivesNothing) {
  ReportLease(Announcement(5, 0, 60));
  EXPECT_FALSE(MayBeSent(Hello(), 1));
  EXPECT_FALSE(checker_.WhyQuiet(actor_name::kSync, 3, Hello(), At(1)).has_value()) << "another agent";
}

TEST_F(LeaseCheckerTest, TheLastAnnouncementIsValid) {
  ReportLease(Announcement(5, 0, 60));
  ReportLease(Announcement(5, 0, 60), 30);
  EXPECT_TRUE(MayBeSent(Hello(), 61)) << "a repeated report is the same lease";
  ReportLease(Announcement(7, 0, 0), 70);
  ReportLease(Announcement(6, 0, 60), 71);
  EXPECT_TRUE(MayBeSent(Hello(), 72)) << "late";
  ReportLease(Announcement(std::uint64_t{1} << 40, 0, 60), 80);
  EXPECT_FALSE(MayBeSent(Hello(), 81)) << "after a restart";
}

TEST_F(LeaseCheckerTest, TheRobotCanEndALease) {
  ReportLease(Lease(proto::LEASE_KIND_DRIVING, 60));
  ReportLease(Lease(proto::LEASE_KIND_DRIVING, 0), 10);
  EXPECT_TRUE(MayBeSent(Batch(proto::POSE_GRAPH_NODE, 1), 11));
  EXPECT_EQ(checker_.LastQuiet(kSelf, At(30)), At(10));
}

TEST_F(LeaseCheckerTest, ARestartedActorAsksFirst) {
  ReportLease(Lease(proto::LEASE_KIND_SLEEPING, 60));
  checker_.OnFailure(actor_name::kSync);
  EXPECT_TRUE(MayBeSent(Hello(), 10));
  ReportSync(10);
  EXPECT_TRUE(MayBeSent(Hello(), 10)) << "in the same instant";
  EXPECT_FALSE(MayBeSent(Hello(), 11));
  checker_.OnFailure(actor_name::kLease);
  EXPECT_TRUE(MayBeSent(Hello(), 11)) << "nobody knows any more";
}

TEST_F(LeaseCheckerTest, KnowsWhenAnAgentWasQuietLast) {
  EXPECT_EQ(checker_.LastQuiet(kOther, At(10)), MonotonicTime::min());
  ReportLease(Announcement(5, 20, 40));
  EXPECT_EQ(checker_.LastQuiet(kOther, At(10)), At(10));
  EXPECT_EQ(checker_.LastQuiet(kOther, At(100)), At(40));
  ReportLease(Announcement(6, 0, 0), 30);
  EXPECT_EQ(checker_.LastQuiet(kOther, At(100)), At(30));
}

}  // namespace
}  // namespace moondb::simulation
