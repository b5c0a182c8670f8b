#include "apps/moondb_sim/byzantine_checker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr AgentId kLiar = 3;
const RecordKey kOfAgent1{{1, 7, proto::POWER}, 2};

proto::Record State(double battery_ratio) {
  proto::Record record;
  record.mutable_power()->set_battery_ratio(battery_ratio);
  return record;
}

class ByzantineCheckerTest : public testing::Test {
 protected:
  // Shows the checker a StoreRequest with this record to agent 2's storage, and the StoreReply with these counts.
  // Returns the result of OnStoreReply: true if the Byzantine agent caused all rejections.
  bool Store(AgentId sender, const RecordKey& key, const proto::Record& record, std::uint32_t stored_count,
             std::uint32_t rejected_count = 0) {
    proto::Message request;
    request.set_request_id(++request_id_);
    request.mutable_store_request()->set_sender(sender);
    proto::StoredRecord& stored = *request.mutable_store_request()->add_records();
    *stored.mutable_key() = ToProto(key);
    stored.set_content(record.SerializeAsString());
    checker_.OnStoreRequest(2, request);
    proto::Message reply;
    reply.set_request_id(request_id_);
    reply.mutable_store_reply()->set_stored_count(stored_count);
    reply.mutable_store_reply()->set_rejected_count(rejected_count);
    return checker_.OnStoreReply(2, reply);
  }

  proto::RoleAssignment Roles(AgentId issuer, const std::string& reason) {
    proto::RoleAssignment roles;
    roles.mutable_term()->set_issuer(issuer);
    roles.set_leader(1);
    roles.set_survivor(2);
    roles.set_reason(reason);
    return roles;
  }

  std::vector<std::string> broken_;
  ByzantineChecker checker_{kLiar, [this](const std::string& rule, const std::string&) { broken_.push_back(rule); }};
  std::uint64_t request_id_ = 0;
};

TEST_F(ByzantineCheckerTest, StoresNoForgedRecord) {
  checker_.OnForged(State(0.25));
  Store(kLiar, kOfAgent1, State(0.25), /*stored_count=*/0);
  Store(kLiar, {{kLiar, 7, proto::POWER}, 1}, State(0.25), 1);
  Store(kLiar, kOfAgent1, State(0.5), 1);
  Store(/*sender=*/1, kOfAgent1, State(0.5), 1);
  EXPECT_THAT(broken_, IsEmpty());
  Store(kLiar, kOfAgent1, State(0.25), 1);
  EXPECT_THAT(broken_, ElementsAre("only_own_lies"));
}

TEST_F(ByzantineCheckerTest, OnlyRecordsOfTheByzantineAgentAreRefused) {
  EXPECT_TRUE(Store(kLiar, kOfAgent1, State(0.5), 0, /*rejected_count=*/1));
  EXPECT_TRUE(Store(/*sender=*/1, {{kLiar, 7, proto::POWER}, 1}, State(0.5), 0, 1));
  EXPECT_FALSE(Store(/*sender=*/1, kOfAgent1, State(0.5), 0, 1));
}

TEST_F(ByzantineCheckerTest, PassesNoForgedRecordOn) {
  checker_.OnForged(State(0.25));
  checker_.OnRecord(2, kOfAgent1, State(0.5).SerializeAsString());
  checker_.OnRecord(kLiar, kOfAgent1, State(0.25).SerializeAsString());
  EXPECT_THAT(broken_, IsEmpty());
  checker_.OnRecord(2, kOfAgent1, State(0.25).SerializeAsString());
  proto::Record marked = State(0.25);
  marked.set_is_clock_suspect(true);
  checker_.OnRecord(2, kOfAgent1, marked.SerializeAsString());
  EXPECT_THAT(broken_, ElementsAre("only_own_lies", "only_own_lies"));
}

TEST_F(ByzantineCheckerTest, HonestAgentsCoverNoRecordThatNeverExisted) {
  checker_.OnImpossible(kOfAgent1);
  HaveSet have;
  have[kOfAgent1.stream].held.Add(1);
  checker_.CheckHave(2, have);
  EXPECT_THAT(broken_, IsEmpty());
  have[kOfAgent1.stream].dropped.Add(2);
  checker_.CheckHave(kLiar, have);
  EXPECT_THAT(broken_, IsEmpty());
  checker_.CheckHave(2, have);
  EXPECT_THAT(broken_, ElementsAre("only_own_lies"));
}

TEST_F(ByzantineCheckerTest, ActsOnNoRolesOfTheLiars) {
  checker_.OnRoles(2, Roles(1, "swap"));
  checker_.OnRoles(kLiar, Roles(kLiar, "its own"));
  EXPECT_THAT(broken_, IsEmpty());
  checker_.OnRoles(2, Roles(kLiar, "its own"));
  checker_.OnRoles(2, Roles(1, kByzantineReason));
  EXPECT_THAT(broken_, ElementsAre("honest_roles", "honest_roles"));
  EXPECT_FALSE(checker_.is_trusted());
}

TEST_F(ByzantineCheckerTest, AnAgentWithARoleFromAnHonestAgentIsTrusted) {
  proto::RoleAssignment roles = Roles(1, "step down");
  roles.set_survivor(kLiar);
  checker_.OnRoles(2, roles);
  EXPECT_TRUE(checker_.is_trusted());
  checker_.OnRoles(2, Roles(kLiar, "its turn"));
  EXPECT_THAT(broken_, IsEmpty());
}

TEST_F(ByzantineCheckerTest, InAnIdleTeamTheLeaderCoversRecordsThatOthersHold) {
  const std::string content = State(0.5).SerializeAsString();
  QuiescentTeam team{1, 2, 4, {}, {}, {}};
  team.records[1][kOfAgent1] = content;
  team.records[2][kOfAgent1] = content;
  team.records[2][{{kLiar, 7, proto::POWER}, 1}] = content;
  team.records[2][{{1, 7, proto::OPTIMIZED_POSE}, 1}] = content;
  team.records[2][{{1, 7, proto::MAP_MATCH}, 1}] = content;
  team.records[kLiar][{{1, 7, proto::POWER}, 9}] = content;
  team.have[1][kOfAgent1.stream].held.Add(kOfAgent1.seq);
  checker_.CheckQuiescent(team);
  EXPECT_THAT(broken_, IsEmpty());
  team.records[2][kOfAgent1] = State(0.25).SerializeAsString();
  checker_.CheckQuiescent(team);
  EXPECT_THAT(broken_, ElementsAre("honest_converge"));
  team.records[2][kOfAgent1] = content;
  team.records[2][{{2, 7, proto::POWER}, 1}] = content;
  checker_.CheckQuiescent(team);
  EXPECT_THAT(broken_, ElementsAre("honest_converge", "honest_converge"));
  team.records[2].erase({{2, 7, proto::POWER}, 1});
  team.records[2][{{1, 7, proto::POWER}, 3}] = content;
  checker_.CheckQuiescent(team);
  EXPECT_EQ(broken_.size(), 3u);
  team.never_had_role = {2};
  checker_.CheckQuiescent(team);
  EXPECT_EQ(broken_.size(), 3u) << "agent 2 may not pass on records of agent 1";
}

TEST(ByzantineCheckerWithoutOneTest, NothingIsWrong) {
  ByzantineChecker checker(0, [](const std::string& rule, const std::string&) { ADD_FAILURE() << rule; });
  proto::Message request;
  request.mutable_store_request()->add_records();
  checker.OnStoreRequest(2, request);
  EXPECT_FALSE(checker.OnStoreReply(2, {}));
  proto::RoleAssignment roles;
  roles.set_leader(1);
  checker.OnRoles(2, roles);
  checker.CheckQuiescent({});
  EXPECT_FALSE(checker.is_trusted());
}

}  // namespace
}  // namespace moondb::simulation
