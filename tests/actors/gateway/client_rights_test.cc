#include "actors/gateway/client_rights.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace moondb {
namespace {

// The requests that need each right. The lists are written by hand: a new request needs the right `command` until it is
// added to kView or kShare.
const std::set<std::string> kView = {"status",      "read",        "role_show",      "share_status",
                                     "graph_stats", "trace",       "have",           "verify",
                                     "fingerprint", "merge",       "map_why",        "map_stats",
                                     "map_tiles",   "read_bundle", "share_progress", "registration"};
const std::set<std::string> kShare = {"insert", "share", "lease", "optimize", "custom"};
const std::set<std::string> kCommand = {"role_set", "stop", "prune", "downlink", "acknowledge"};

TEST(ClientRightsTest, EveryRequestIsAssignedARight) {
  const auto* requests = proto::ControlRequest::descriptor()->FindOneofByName("request");
  ASSERT_NE(requests, nullptr);
  for (int i = 0; i < requests->field_count(); ++i) {
    const auto* field = requests->field(i);
    const auto needed = RightsNeededFor(static_cast<proto::ControlRequest::RequestCase>(field->number()));
    if (kView.contains(field->name())) {
      EXPECT_EQ(needed, proto::CLIENT_RIGHTS_VIEW) << field->name();
    }
    if (kShare.contains(field->name())) {
      EXPECT_EQ(needed, proto::CLIENT_RIGHTS_SHARE) << field->name();
    }
    if (!kView.contains(field->name()) && !kShare.contains(field->name())) {
      EXPECT_EQ(needed, proto::CLIENT_RIGHTS_COMMAND) << field->name() << " is not listed here";
    }
  }
  for (const std::set<std::string>& listed : {kView, kShare, kCommand}) {
    for (const std::string& name : listed) {
      EXPECT_NE(proto::ControlRequest::descriptor()->FindFieldByName(name), nullptr) << name;
    }
  }
}

TEST(ClientRightsTest, NamesTheNeededAndTheGrantedRight) {
  proto::Message message;
  message.set_client_name("anna");
  message.set_client_rights(proto::CLIENT_RIGHTS_VIEW);
  const auto checked = CheckClientRights(message, proto::ControlRequest::kInsert);
  ASSERT_FALSE(checked.has_value());
  EXPECT_EQ(checked.error().code, ErrorCode::kRefused);
  EXPECT_EQ(checked.error().text, "this needs the right to share; the key of anna has the right to view");
  message.set_client_rights(proto::CLIENT_RIGHTS_NONE);
  EXPECT_EQ(CheckClientRights(message, proto::ControlRequest::kInsert).error().text,
            "your key is no longer listed at this agent");
  message.set_client_rights(proto::CLIENT_RIGHTS_SHARE);
  EXPECT_TRUE(CheckClientRights(message, proto::ControlRequest::kInsert).has_value());
  message.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);
  EXPECT_TRUE(CheckClientRights(message, proto::ControlRequest::kInsert).has_value());
}

// Returns a team of rovers 1 and 2 and base station 3.
proto::TeamConfig TeamWithBase() {
  proto::TeamConfig team;
  for (const std::uint32_t id : {1, 2, 3}) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(id);
    agent.set_name(id == 3 ? "base" : "rover" + std::to_string(id));
    if (id == 3) agent.set_kind(proto::AGENT_KIND_BASE_STATION);
  }
  return team;
}

TEST(RelayRightsTest, BelongToTheBaseStationUnlessTheTeamFileNamesOthers) {
  proto::TeamConfig team = TeamWithBase();
  proto::ControlRequest stop;
  stop.mutable_stop();
  EXPECT_TRUE(CheckRelayRights(team, 1, {}, 3, stop));
  const Result<void> refused = CheckRelayRights(team, 1, {}, 2, stop);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_EQ(refused.error().field, "command_from");
  team.add_command_from("rover2");
  EXPECT_TRUE(CheckRelayRights(team, 1, {}, 2, stop));
  EXPECT_FALSE(CheckRelayRights(team, 1, {}, 3, stop));
  team.set_command_from(0, "all");
  EXPECT_TRUE(CheckRelayRights(team, 1, {}, 2, stop));
  EXPECT_FALSE(CheckRelayRights(team, 1, {}, 9, stop)) << "of no agent of the team";
}

TEST(RelayRightsTest, DoNotBelongToAnAgentThatHasLeft) {
  proto::TeamConfig team = TeamWithBase();
  team.add_command_from("all");
  team.mutable_agents(1)->set_left(true);
  proto::RoleAssignment roles;
  roles.set_leader(2);
  proto::ControlRequest share;
  share.mutable_share();
  const Result<void> refused = CheckRelayRights(team, 1, roles, 2, share);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().text, "rover2 has left the team");
  proto::ControlRequest read;
  read.mutable_read();
  EXPECT_FALSE(CheckRelayRights(team, 1, roles, 2, read));
}

TEST(RelayRightsTest, BelongToEveryAgentInATeamWithoutABaseStation) {
  proto::TeamConfig team = TeamWithBase();
  team.mutable_agents()->RemoveLast();
  proto::ControlRequest stop;
  stop.mutable_stop();
  EXPECT_TRUE(CheckRelayRights(team, 1, {}, 2, stop));
}

TEST(RelayRightsTest, AllowQuestionsToAllAndSharingToLeaderAndSurvivor) {
  const proto::TeamConfig team = TeamWithBase();
  proto::RoleAssignment roles;
  roles.set_leader(2);
  proto::ControlRequest read;
  read.mutable_read();
  EXPECT_TRUE(CheckRelayRights(team, 1, {}, 2, read));
  proto::ControlRequest share;
  share.mutable_share();
  EXPECT_FALSE(CheckRelayRights(team, 1, {}, 2, share));
  EXPECT_TRUE(CheckRelayRights(team, 1, roles, 2, share));
  roles.set_leader(1);
  roles.set_survivor(2);
  EXPECT_TRUE(CheckRelayRights(team, 1, roles, 2, share));
  proto::ControlRequest insert;
  insert.mutable_insert();
  EXPECT_FALSE(CheckRelayRights(team, 1, roles, 2, insert)) << "in this agent's name";
}

}  // namespace
}  // namespace moondb
