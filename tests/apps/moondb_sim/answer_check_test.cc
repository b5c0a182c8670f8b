#include "apps/moondb_sim/answer_check.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

constexpr StreamKey kPowers{1, 5, proto::POWER};

// Returns facts of agent 1, which holds three states and leads in term 2. The term is stored on its disk.
AgentFacts Facts() {
  AgentFacts facts;
  facts.self = 1;
  facts.before[kPowers].held.Add({1, 3});
  facts.after = facts.before;
  facts.roles.set_leader(1);
  facts.roles.set_survivor(2);
  facts.roles.mutable_term()->set_number(2);
  facts.durable_term = facts.roles.term();
  return facts;
}

proto::ControlReply Inserted(const RecordKey& key) {
  proto::ControlReply reply;
  *reply.mutable_insert()->add_keys() = ToProto(key);
  return reply;
}

TEST(AnswerCheckTest, AnInsertedRecordIsStored) {
  proto::ControlRequest request;
  request.mutable_insert()->add_records()->mutable_power();
  EXPECT_EQ(WhyUntrue(request, Inserted({kPowers, 3}), Facts()), std::nullopt);
  EXPECT_NE(WhyUntrue(request, Inserted({kPowers, 4}), Facts()), std::nullopt);
  EXPECT_NE(WhyUntrue(request, Inserted({{2, 5, proto::POWER}, 3}), Facts()), std::nullopt);
  EXPECT_NE(WhyUntrue(request, {}, Facts()), std::nullopt);
}

TEST(AnswerCheckTest, ACompletePageContainsAllHeldRecords) {
  proto::ControlRequest request;
  request.mutable_read()->add_data_types(proto::POWER);
  proto::ControlReply reply;
  for (std::uint64_t seq = 1; seq <= 3; ++seq) {
    *reply.mutable_read()->add_records()->mutable_key() = ToProto(RecordKey{kPowers, seq});
  }
  reply.mutable_read()->set_is_complete(true);
  EXPECT_EQ(WhyUntrue(request, reply, Facts()), std::nullopt);
  reply.mutable_read()->mutable_records()->RemoveLast();
  EXPECT_NE(WhyUntrue(request, reply, Facts()), std::nullopt);
  reply.mutable_read()->set_is_complete(false);
  EXPECT_EQ(WhyUntrue(request, reply, Facts()), std::nullopt);
  *reply.mutable_read()->add_records()->mutable_key() = ToProto(RecordKey{kPowers, 9});
  EXPECT_NE(WhyUntrue(request, reply, Facts()), std::nullopt);
}

TEST(AnswerCheckTest, NoRolesOlderThanTheDisksAreShown) {
  proto::ControlRequest request;
  request.mutable_role_show();
  proto::ControlReply reply;
  *reply.mutable_roles()->mutable_roles() = Facts().roles;
  EXPECT_EQ(WhyUntrue(request, reply, Facts()), std::nullopt);
  reply.mutable_roles()->mutable_roles()->mutable_term()->set_number(1);
  EXPECT_NE(WhyUntrue(request, reply, Facts()), std::nullopt);
}

TEST(AnswerCheckTest, ARoleThatWasSetIsOnTheDisk) {
  proto::ControlRequest request;
  request.mutable_role_set()->set_leader(1);
  proto::ControlReply reply;
  *reply.mutable_roles()->mutable_roles() = Facts().roles;
  EXPECT_EQ(WhyUntrue(request, reply, Facts()), std::nullopt);
  reply.mutable_roles()->mutable_roles()->mutable_term()->set_number(3);
  EXPECT_NE(WhyUntrue(request, reply, Facts()), std::nullopt);
  request.mutable_role_set()->set_is_dry_run(true);
  EXPECT_EQ(WhyUntrue(request, reply, Facts()), std::nullopt);
}

TEST(AnswerCheckTest, ALeaseIsAsLongAsWasAskedFor) {
  proto::ControlRequest request;
  request.mutable_lease()->set_kind(proto::LEASE_KIND_DRIVING);
  request.mutable_lease()->set_seconds(20);
  proto::ControlReply reply;
  EXPECT_NE(WhyUntrue(request, reply, Facts()), std::nullopt);
  proto::AgentLease& lease = *reply.mutable_lease()->add_leases();
  lease.set_agent_id(1);
  lease.set_driving_s(20);
  EXPECT_EQ(WhyUntrue(request, reply, Facts()), std::nullopt);
}

TEST(AnswerCheckTest, OnlyTheLeaderSolvesAndADryPruneChangesNothing) {
  AgentFacts facts = Facts();
  proto::ControlRequest solve;
  solve.mutable_optimize();
  proto::ControlRequest prune;
  prune.mutable_prune()->set_is_dry_run(true);
  EXPECT_EQ(WhyUntrue(solve, {}, facts), std::nullopt);
  EXPECT_EQ(WhyUntrue(prune, {}, facts), std::nullopt);
  facts.roles.set_leader(2);
  facts.after[kPowers].held.Remove(1);
  EXPECT_NE(WhyUntrue(solve, {}, facts), std::nullopt);
  EXPECT_NE(WhyUntrue(prune, {}, facts), std::nullopt);
}

}  // namespace
}  // namespace moondb::simulation
