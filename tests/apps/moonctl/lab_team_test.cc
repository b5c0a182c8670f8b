#include "apps/moonctl/lab_team.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/moonctl/radio_estimate.h"
#include "proto/types.pb.h"
#include "runtime/team/team_config.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::StartsWith;

LabOptions Robots(int count) {
  LabOptions options;
  options.team = "lab";
  options.robot_count = count;
  return options;
}

TEST(LabTeamTest, RobotsShareEverythingByThemselves) {
  const TemporaryFolder folder;
  LabOptions options = Robots(3);
  options.addresses = {"rover1=10.0.0.11", "rover2=robot2.local:7500", "rover3=[fe80::1%wlan0]"};
  const Result<proto::TeamConfig> team = MakeLabTeam(options);
  ASSERT_TRUE(team) << team.error().text;
  ASSERT_TRUE(WriteTeam(folder.path() / "team.yaml", *team));
  const Result<TeamFile> read = ReadTeamFile(folder.path() / "team.yaml");
  ASSERT_TRUE(read) << read.error().text;
  const proto::TeamConfig& config = read->config;
  ASSERT_EQ(config.agents_size(), 3);
  EXPECT_EQ(config.agents(0).address(), "tcp://10.0.0.11:7400");
  EXPECT_EQ(config.agents(1).address(), "tcp://robot2.local:7500");
  EXPECT_EQ(config.agents(2).address(), "tcp://[fe80::1%wlan0]:7400");
  EXPECT_EQ(config.radio().sync_period_s(), 2);
  EXPECT_FALSE(config.radio().quiet_while_driving());
  EXPECT_EQ(config.roles().failover(), proto::FAILOVER_AUTOMATIC);
  EXPECT_EQ(config.roles().leader_timeout_s(), 15);
  EXPECT_EQ(RoversPolicyOf(config, proto::LOCAL_TRAVERSABILITY_MAP), proto::POLICY_ALL);
  EXPECT_EQ(RoversPolicyOf(config, proto::OPTIMIZED_POSE), proto::POLICY_LATEST);
  EXPECT_EQ(RoversPolicyOf(config, proto::POSE_GRAPH_EDGE), proto::POLICY_ALL);
  EXPECT_EQ(RoversPolicyOf(config, proto::POWER), proto::POLICY_LATEST);
}

TEST(LabTeamTest, ALargerTeamLeavesEdgesToLeaderAndSurvivor) {
  EXPECT_EQ(RoversPolicyOf(*MakeLabTeam(Robots(5)), proto::POSE_GRAPH_EDGE), proto::POLICY_NONE);
  EXPECT_EQ(RoversPolicyOf(*MakeLabTeam(Robots(5)), proto::POSE_GRAPH_NODE), proto::POLICY_ALL);
}

TEST(LabTeamTest, TwoAgentsDoNotReplaceEachOther) {
  EXPECT_EQ(MakeLabTeam(Robots(2))->roles().failover(), proto::FAILOVER_MANUAL);
  LabOptions options = Robots(2);
  options.base = "desk";
  const Result<proto::TeamConfig> team = MakeLabTeam(options);
  EXPECT_EQ(team->roles().failover(), proto::FAILOVER_AUTOMATIC);
  EXPECT_EQ(team->agents(2).name(), "desk");
  EXPECT_EQ(GroundPolicyOf(*team, proto::LOCAL_TRAVERSABILITY_MAP), proto::POLICY_ALL);
}

TEST(LabTeamTest, NamesTheAddressThatItCannotUse) {
  const auto error = [](const std::string& address) {
    LabOptions options = Robots(2);
    options.addresses = {address};
    const Result<proto::TeamConfig> team = MakeLabTeam(options);
    return team ? Error{} : team.error();
  };
  EXPECT_THAT(error("10.0.0.11").text, StartsWith("expected NAME=HOST or NAME=HOST:PORT, got '10.0.0.11'"));
  EXPECT_THAT(error("rover1=").text, StartsWith("expected NAME=HOST"));
  EXPECT_THAT(error("rover3=10.0.0.13").text,
              HasSubstr("'rover3' is not an agent of this team; its agents are rover1 to rover2"));
  EXPECT_EQ(error("rover3=10.0.0.13").field, "--address");
}

TEST(RadioEstimateTest, GrowsWithTheSquareOfTheTeamAndWarnsAboveFivePercent) {
  proto::TeamConfig team;
  team.mutable_radio()->set_budget_kbps(1000);
  EXPECT_EQ(TeamMapText(team), "");
  for (const char* type : {"pose_graph_node", "optimized_pose", "local_traversability_map"}) {
    (*team.mutable_rovers())[type] = proto::POLICY_ALL;
  }
  for (std::uint32_t id = 1; id <= 3; ++id) team.add_agents()->set_id(id);
  EXPECT_NEAR(TeamMapPart(team) * 3600, 18.5, 0.5) << "5.2 s of records, and 12 solves of 1.1 s";
  EXPECT_THAT(TeamMapText(team), StartsWith("note: sending the team's map to every rover takes about 18 s"));
  for (std::uint32_t id = 4; id <= 30; ++id) team.add_agents()->set_id(id);
  EXPECT_NEAR(TeamMapPart(team) * 3600, 1100 + 12 * 159, 60);
  EXPECT_THAT(TeamMapText(team), StartsWith("warning: "));
}

}  // namespace
}  // namespace moondb
