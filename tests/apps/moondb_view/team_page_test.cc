#include "apps/moondb_view/team_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/moondb_view/timeline.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::Not;

constexpr StreamKey kOwnNodes{1, 7, proto::POSE_GRAPH_NODE};
constexpr StreamKey kOtherNodes{2, 7, proto::POSE_GRAPH_NODE};

// Three rovers and a base station, seen from rover1, which leads.
class TeamPageTest : public testing::Test {
 protected:
  TeamPageTest() {
    team_.set_team("lab");
    for (std::uint32_t id = 1; id <= 4; ++id) {
      proto::AgentConfig& agent = *team_.add_agents();
      agent.set_id(id);
      agent.set_name(id == 4 ? "base" : "rover" + std::to_string(id));
      if (id == 4) agent.set_kind(proto::AGENT_KIND_BASE_STATION);
    }
    team_.mutable_radio()->set_sync_period_s(10);
    reports_.agent = 1;
    reports_.agents[1] = ReportBy(1);
    for (std::uint32_t id = 2; id <= 4; ++id) {
      proto::PeerStatus& peer = *Own().add_peers();
      peer.set_agent_id(id);
      peer.set_is_connected(true);
      peer.set_seconds_since_heard(0.5);
    }
    reports_.agents[1].graph.emplace();
    reports_.agents[1].report.registration.emplace().set_is_done(true);
  }

  ReportedAgent ReportBy(std::uint32_t id) const {
    ReportedAgent reported;
    proto::AgentStatus& status = reported.report.status.emplace();
    status.set_agent_id(id);
    status.set_name(id == 4 ? "base" : "rover" + std::to_string(id));
    status.set_role(id == 1 ? proto::ROLE_LEADER : proto::ROLE_ROVER);
    status.mutable_roles()->set_leader(1);
    status.mutable_roles()->set_survivor(2);
    reported.report.shares.emplace();
    return reported;
  }

  proto::AgentStatus& Own() { return *reports_.agents[1].report.status; }
  std::string Page() const { return TeamPageJson(team_, reports_); }

  proto::TeamConfig team_;
  TeamReports reports_;
};

TEST_F(TeamPageTest, SaysWhoLeads) {
  EXPECT_THAT(Page(), HasSubstr(R"("leader":{"is_known":true,"is_good":true,)"
                                R"("text":"rover1 leads; rover2 is the designated survivor",)"
                                R"("leader":"rover1","survivor":"rover2"})"));
  Own().mutable_roles()->set_survivor(0);
  EXPECT_THAT(Page(), HasSubstr(R"("is_good":false,"text":"rover1 leads, without a designated survivor")"));
  reports_.why_silent = "the agent is not running";
  EXPECT_THAT(Page(), HasSubstr(R"("leader":{"is_known":false,"is_good":false)"));
  EXPECT_THAT(Page(), HasSubstr(R"("source":{"is_reachable":false)"));
}

TEST_F(TeamPageTest, SaysWhatLosingTheLeaderWouldCost) {
  EXPECT_TRUE(LossAnswer(team_, reports_).is_good);
  Own().mutable_storage()->mutable_one_copy()->set_count(12);
  Own().mutable_storage()->mutable_one_copy()->set_age_s(40);
  EXPECT_FALSE(LossAnswer(team_, reports_).is_good);
  EXPECT_EQ(LossAnswer(team_, reports_).text, "12 records, the oldest 40 s old, exist on rover1's disk only");
  EXPECT_THAT(Page(), HasSubstr(R"("count":12,"age_s":40})"));
  // Another agent's page does not know what only the leader knows.
  Own().mutable_roles()->set_leader(3);
  EXPECT_FALSE(LossAnswer(team_, reports_).is_known);
  reports_.agents[3] = ReportBy(3);
  EXPECT_TRUE(LossAnswer(team_, reports_).is_known) << "the team was asked";
  reports_.agents[3].age_s = 2 * kAnswerAgeMax_s;
  EXPECT_FALSE(LossAnswer(team_, reports_).is_known) << "long ago";
  EXPECT_EQ(LossAnswer(team_, reports_).text, "not known: ask the team");
  Own().mutable_peers(1)->set_is_connected(false);
  EXPECT_EQ(LossAnswer(team_, reports_).text, "not known: rover3, which leads, is silent");
}

TEST_F(TeamPageTest, SaysWhoIsSilent) {
  EXPECT_EQ(SilentAnswer(team_, reports_).text, "nobody: rover1 hears every agent");
  proto::PeerStatus& rover3 = *Own().mutable_peers(1);
  rover3.set_is_connected(false);
  rover3.set_seconds_since_heard(240);
  EXPECT_FALSE(SilentAnswer(team_, reports_).is_good);
  EXPECT_EQ(SilentAnswer(team_, reports_).text, "rover3 is silent for 4 min");
  EXPECT_THAT(Page(), HasSubstr(R"("agents":["rover3"])"));
  rover3.set_seconds_since_heard(-1);
  EXPECT_EQ(SilentAnswer(team_, reports_).text, "rover3 was never heard");
  EXPECT_THAT(Page(), HasSubstr(R"("link":{"state":"silent","heard_s":null})"));
  proto::AgentLease& lease = *Own().add_leases();
  lease.set_agent_id(3);
  lease.set_sleeping_s(60);
  EXPECT_TRUE(SilentAnswer(team_, reports_).is_good) << "it sleeps";
  EXPECT_THAT(Page(), HasSubstr(R"("agents":[]})"));
}

TEST_F(TeamPageTest, SaysThatMapsAreCurrentOnlyIfAllAgentsSaySo) {
  EXPECT_FALSE(MapsAnswer(team_, reports_).is_known) << "the others were not asked";
  for (std::uint32_t id = 2; id <= 4; ++id) reports_.agents[id] = ReportBy(id);
  EXPECT_TRUE(MapsAnswer(team_, reports_).is_known);
  EXPECT_TRUE(MapsAnswer(team_, reports_).is_good);
  reports_.agents[3].report.shares->add_due(2);
  EXPECT_EQ(MapsAnswer(team_, reports_).text, "no: rover3 has records to send to rover2");
  reports_.agents[3].report.shares->clear_due();
  reports_.agents[1].graph->set_is_due(true);
  EXPECT_EQ(MapsAnswer(team_, reports_).text, "no: a solve of the pose graph is due");
  reports_.agents[1].graph->set_is_due(false);
  reports_.agents.erase(3);
  Own().mutable_peers(1)->set_is_connected(false);
  EXPECT_EQ(MapsAnswer(team_, reports_).text, "no: rover3 does not answer; the other agents have settled");
  team_.mutable_radio()->set_sync_period_s(0);
  EXPECT_FALSE(MapsAnswer(team_, reports_).is_known) << "records move on command";
}

TEST_F(TeamPageTest, ASilentLeaderIsNotSaidToWork) {
  Own().mutable_roles()->set_leader(3);
  reports_.agents[2] = ReportBy(2);
  reports_.agents[4] = ReportBy(4);
  EXPECT_FALSE(MapsAnswer(team_, reports_).is_known);
  Own().mutable_peers(1)->set_is_connected(false);
  EXPECT_EQ(MapsAnswer(team_, reports_).text, "no: rover3 does not answer; the other agents have settled");
}

TEST_F(TeamPageTest, OneAgentsOwnBacklogIsKnownWithoutAskingTheTeam) {
  reports_.agents[1].report.shares->add_due(2);
  EXPECT_EQ(MapsAnswer(team_, reports_).text, "no: rover1 has records to send to rover2");
}

TEST_F(TeamPageTest, WhatNobodyReportedIsUnknownAndNotZero) {
  const std::string page = Page();
  EXPECT_THAT(page, HasSubstr(R"("name":"rover2","role":"designated_survivor","is_left":false,)"
                              R"("link":{"state":"connected","heard_s":0.5},"battery":null,"clock":null,"disk":null)"));
  EXPECT_THAT(page, HasSubstr(R"("is_placed":null)"));
  EXPECT_THAT(page, HasSubstr(R"({"agent":"rover2","is_known":false,"age_s":null,"cells":[null,null,null,null]})"));
}

TEST_F(TeamPageTest, ShowsWhoHasWhat) {
  HaveSet own;
  own[kOwnNodes].held.Add({1, 10});
  own[kOtherNodes].held.Add({1, 4});
  reports_.agents[1].holds = own;
  proto::PeerBacklog& backlog = *Own().mutable_storage()->add_backlogs();
  backlog.set_agent_id(2);
  backlog.set_own_count(3);
  proto::ShareSession& session = *reports_.agents[1].report.shares->add_sessions();
  session.set_destination(2);
  session.set_is_open(true);
  session.set_is_remaining_known(true);
  session.set_remaining(3);
  session.set_session_s(10);
  session.set_session_acknowledged_records(5);
  // Alone, rover1 does not know whether rover2 made more than these four.
  EXPECT_THAT(Page(),
              HasSubstr(R"("cells":[{"held":10,"missing":0,"eta_s":null},{"held":4,"missing":null,"eta_s":null})"));
  EXPECT_THAT(Page(), HasSubstr(R"({"agent":"rover2","is_known":false,"age_s":null,)"
                                R"("cells":[{"held":7,"missing":3,"eta_s":6},null,null,null]})"));
  HaveSet others;
  others[kOtherNodes].held.Add({1, 6});
  others[kOwnNodes].held.Add({1, 8});
  reports_.agents[2] = ReportBy(2);
  reports_.agents[2].holds = others;
  EXPECT_THAT(Page(), HasSubstr(R"({"held":4,"missing":2,"eta_s":null})"));
  EXPECT_THAT(Page(), HasSubstr(R"({"held":8,"missing":2,"eta_s":6})"));
  // An old answer says nothing about now: not even that rover2 holds nothing.
  reports_.agents[2].age_s = 2 * kAnswerAgeMax_s;
  EXPECT_THAT(Page(), HasSubstr(R"({"agent":"rover2","is_known":false,"age_s":null,)"
                                R"("cells":[{"held":7,"missing":3,"eta_s":6},null,null,null]})"));
}

TEST_F(TeamPageTest, RecordsThatCameAfterTheQuestionAreNoGap) {
  HaveSet others;
  others[kOtherNodes].held.Add({1, 6});
  reports_.agents[2] = ReportBy(2);
  reports_.agents[2].holds = reports_.agents[2].own_holds_then = others;
  reports_.agents[1].holds = others;
  (*reports_.agents[1].holds)[kOtherNodes].held.Add({7, 9});
  EXPECT_THAT(Page(),
              HasSubstr(R"("agent":"rover2","is_known":true,"age_s":0,)"
                        R"("cells":[{"held":0,"missing":null,"eta_s":null},{"held":6,"missing":0,"eta_s":null})"));
  EXPECT_THAT(Page(), HasSubstr(R"({"held":9,"missing":0,"eta_s":null})")) << "rover1 has more";
}

TEST_F(TeamPageTest, ShowsTheFindingsOfHealth) {
  Own().mutable_storage()->set_write_trouble("the disk is full");
  EXPECT_THAT(Page(), HasSubstr(R"("findings":[{"agent":"rover1","text":")"));
  EXPECT_THAT(Page(), HasSubstr("the disk is full"));
}

TEST_F(TeamPageTest, TheTimelineShowsOnlyCountsThatAreKnown) {
  HaveSet own;
  own[kOwnNodes].held.Add({1, 10});
  own[kOtherNodes].held.Add({1, 4});
  reports_.agents[1].holds = own;
  proto::PeerBacklog& backlog = *Own().mutable_storage()->add_backlogs();
  backlog.set_agent_id(2);
  backlog.set_own_count(3);
  const auto counts = TimelineCountsOf(team_, reports_);
  EXPECT_EQ(counts.at(1).created, 10);
  EXPECT_EQ(counts.at(1).leader, 10);
  EXPECT_EQ(counts.at(1).survivor, 7);
  EXPECT_EQ(counts.at(1).ground, std::nullopt);
  EXPECT_EQ(counts.at(2).created, std::nullopt) << "rover2 may have made more";
  EXPECT_EQ(counts.at(2).leader, 4);
}

TEST(TimelineTest, KeepsFewerSamplesOfLongerTimes) {
  proto::TeamConfig team;
  team.add_agents()->set_id(1);
  Timeline timeline;
  for (int second = 0; second < 10'000; ++second) timeline.Add(second, {{1, {double(second), {}, {}, {}}}});
  const std::string json = timeline.Json(team);
  EXPECT_LE(std::count(json.begin(), json.end(), ','), 5 * static_cast<int>(Timeline::kSamplesMax) + 10);
  EXPECT_THAT(json, HasSubstr(R"("time_s":[0,)"));
  EXPECT_THAT(json, HasSubstr("9999]")) << "the newest one is there";
  EXPECT_THAT(json, HasSubstr(R"("leader":[null,)"));
}

}  // namespace
}  // namespace moondb
