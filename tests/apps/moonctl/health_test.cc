#include "apps/moonctl/health.h"

#include <gmock/gmock.h>

#include "model/ids.h"
#include "model/term.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class HealthTest : public testing::Test {
 protected:
  HealthTest() {
    for (const std::uint32_t id : {1u, 2u}) {
      proto::AgentConfig& agent = *team_.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
      proto::AgentStatus& status = reports_[id].status.emplace();
      status.set_agent_id(id);
      status.mutable_roles()->set_leader(1);
      status.mutable_roles()->set_survivor(2);
      status.mutable_roles()->mutable_term()->set_number(4);
      proto::PeerStatus& peer = *status.add_peers();
      peer.set_agent_id(3 - id);
      peer.set_is_connected(true);
      reports_[id].shares.emplace();
    }
  }

  std::vector<std::string> Of(std::uint32_t agent) { return FindingsOn(team_, reports_)[agent]; }
  proto::AgentStatus& Status(std::uint32_t agent) { return *reports_[agent].status; }

  proto::TeamConfig team_;
  std::map<std::uint32_t, AgentReport> reports_;
};

TEST_F(HealthTest, FindsNothingInAHealthyTeam) { EXPECT_THAT(FindingsOn(team_, reports_), IsEmpty()); }

TEST_F(HealthTest, FindsAgentsInAnOldTermAndLeadersWithoutASurvivor) {
  Status(2).mutable_roles()->mutable_term()->set_number(3);
  EXPECT_THAT(Of(2), ElementsAre("acts on the roles of term 3, but another agent knows term 4"));
  Status(1).mutable_roles()->clear_survivor();
  EXPECT_THAT(Of(1), ElementsAre("leads without a designated survivor: name one with moonctl role set"));
}

TEST_F(HealthTest, FindsWhoCannotStoreItsRolesAndJudgesTheOthersByThem) {
  proto::AgentStatus& deposed = Status(2);
  deposed.mutable_roles()->mutable_term()->set_number(5);
  *deposed.mutable_unstored_roles() = deposed.roles();
  deposed.mutable_roles()->clear_survivor();  // Until agent 2 can store term 5, it has no role.
  *Status(1).mutable_roles() = deposed.unstored_roles();
  EXPECT_THAT(Of(1), IsEmpty());
  EXPECT_THAT(Of(2), ElementsAre("cannot store term 5 (leader rover1, survivor rover2); until it stores the term, it "
                                 "acts neither as leader nor as survivor"));
}

TEST_F(HealthTest, ReportsAFullDiskOnce) {
  proto::StorageStatus& storage = *Status(1).mutable_storage();
  storage.set_space_low("3 MB of disk are free");
  EXPECT_THAT(Of(1), ElementsAre("space low: 3 MB of disk are free"));
  storage.set_refused_inserts("the disk is nearly full: no more maps are accepted");
  EXPECT_THAT(Of(1), ElementsAre("the disk is nearly full: no more maps are accepted"));
  storage.set_write_trouble("the disk is full: free space: moonctl -a rover1 db prune");
  EXPECT_THAT(Of(1), ElementsAre("stores nothing: the disk is full: free space: moonctl -a rover1 db prune"));
}

TEST_F(HealthTest, FindsTwoProcessesWithOneKey) {
  Status(1).mutable_peers(0)->set_has_two_processes(true);
  EXPECT_THAT(Of(1), ElementsAre(HasSubstr("two processes use rover2's key")));
}

TEST_F(HealthTest, FindsUnreachablePeersThatDoNotSleep) {
  proto::PeerStatus& peer = *Status(1).mutable_peers(0);
  peer.set_is_connected(false);
  peer.set_seconds_since_heard(90);
  EXPECT_THAT(Of(1), ElementsAre("does not reach rover2, last heard 90 s ago"));
  peer.set_seconds_since_heard(-1);
  EXPECT_THAT(Of(1), ElementsAre("does not reach rover2, never heard"));
  proto::AgentLease& lease = *Status(1).add_leases();
  lease.set_agent_id(2);
  lease.set_sleeping_s(300);
  EXPECT_THAT(Of(1), IsEmpty());
}

TEST_F(HealthTest, FindsUnacknowledgedRecords) {
  proto::HealthFinding& finding = *Status(1).add_findings();
  finding.set_text("rover2 was lost");
  finding.set_timestamp_ns(1'795'339'884'000'000'000);
  EXPECT_THAT(Of(1), ElementsAre("2026-11-22 09:31:24 UTC: rover2 was lost (not acknowledged)"));
  EXPECT_THAT(Of(2), IsEmpty());
}

TEST_F(HealthTest, FindsWhatAnAgentSuffersItself) {
  Status(1).mutable_storage()->set_clock_suspect("it jumped");
  Status(1).mutable_storage()->set_space_low("1 MB of disk are free");
  proto::ActorStatus& actor = *Status(1).add_actors();
  actor.set_name("sync");
  actor.set_restarts(2);
  actor.set_dropped(7);
  EXPECT_THAT(Of(1), ElementsAre("clock suspect: it jumped", "space low: 1 MB of disk are free",
                                 "sync failed and was restarted 2 times",
                                 "sync dropped 7 messages because its mailbox was full"));
}

TEST_F(HealthTest, FindsClocksThatDifferTooMuch) {
  proto::PeerClockOffset& clock = *Status(1).mutable_storage()->add_peer_clocks();
  clock.set_agent_id(2);
  clock.set_age_s(30);
  clock.set_offset_s(kClockOffsetMax_s);
  EXPECT_THAT(Of(1), IsEmpty());
  clock.set_offset_s(75);
  EXPECT_THAT(Of(1), ElementsAre("its clock is 75 s behind rover2's (reported 30 s ago)"));
  clock.set_offset_s(-75);
  EXPECT_THAT(Of(1), ElementsAre("its clock is 75 s ahead of rover2's (reported 30 s ago)"));
}

TEST_F(HealthTest, OneWrongClockIsAFindingOnItsAgentAlone) {
  const auto add = [this](std::uint32_t agent, std::uint32_t peer, double offset_s) {
    Status(agent).set_agent_id(agent);
    proto::PeerClockOffset& clock = *reports_[agent].status->mutable_storage()->add_peer_clocks();
    clock.set_agent_id(peer);
    clock.set_offset_s(offset_s);
  };
  reports_[3] = reports_[2];
  add(1, 2, 0);
  add(1, 3, 3600);
  add(2, 1, 0);
  add(2, 3, 3600);
  add(3, 1, -3600);
  add(3, 2, -3600);
  EXPECT_THAT(Of(1), IsEmpty());
  EXPECT_THAT(Of(2), IsEmpty());
  EXPECT_EQ(Of(3).size(), 2u);
  reports_.erase(3);
  EXPECT_EQ(Of(1).size(), 1u) << "rover3 does not answer, and is not judged itself";
}

TEST_F(HealthTest, FindsAnOdometryScaleThatNoWheelHas) {
  proto::OptimizeReply& solve = reports_[1].last_solve.emplace();
  solve.add_rovers()->set_agent_id(1);
  solve.mutable_rovers(0)->set_odometry_scale(1.02);
  solve.add_rovers()->set_agent_id(2);
  solve.mutable_rovers(1)->set_odometry_scale(0.044);
  EXPECT_THAT(Of(1), IsEmpty());
  EXPECT_THAT(Of(2), ElementsAre("its odometry scale is 0.044 in the last solve: check the units of its odometry, and "
                                 "that its software inserts only odometry as odometry"));
}

TEST_F(HealthTest, NamesANodeThatLiesFarAwayAtItsRover) {
  proto::FarNode& far = *reports_[1].last_solve.emplace().add_far_nodes();
  *far.mutable_node() = ToProto(NodeKey{2, 500});
  far.set_distance_m(30'100);
  EXPECT_THAT(Of(1), IsEmpty());
  EXPECT_THAT(
      Of(2),
      ElementsAre("node rover2:500 lies 30 km from the team in the last solve: check that its pose is in metres"));
}

TEST_F(HealthTest, NamesARoverWhoseMeasurementsTheLastSolveRefused) {
  proto::OptimizeReply& solve = reports_[1].last_solve.emplace();
  const auto add = [&solve](AgentId producer, std::vector<std::uint32_t> agents, double count) -> proto::RefusedSet& {
    proto::RefusedSet& set = *solve.add_refused_sets();
    set.set_producer(producer);
    set.mutable_agent_ids()->Add(agents.begin(), agents.end());
    set.set_count(count);
    return set;
  };
  add(2, {1, 2}, 1520);
  add(2, {2, 3}, 1).set_is_range(true);
  EXPECT_THAT(Of(1), IsEmpty());
  EXPECT_THAT(Of(3), IsEmpty());
  EXPECT_THAT(Of(2), ElementsAre("the last solve refused 1520 loop closures with rover1, 1 range with agent 3, which "
                                 "contradict the measurements of other agents: check rover2's sensors, or exclude its "
                                 "measurements with 'moonctl graph quarantine --agent rover2'"));

  // Rover2 was not asked, so the leader's report names it.
  const AgentReport of_rover2 = reports_.at(2);
  reports_.erase(2);
  EXPECT_THAT(Of(1), ElementsAre(HasSubstr("check rover2's sensors")));
  reports_[2] = of_rover2;

  // Matches of maps have no producer: either map may be wrong.
  solve.clear_refused_sets();
  add(0, {1, 2}, 7).set_source("registration");
  EXPECT_THAT(Of(1), ElementsAre(HasSubstr("refused 7 loop closures of registration with rover2")));
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("refused 7 loop closures of registration with rover1")));
}

TEST_F(HealthTest, FindsSessionsThatAreStuckButNotThoseThatWait) {
  proto::ShareSession& session = *reports_[2].shares->add_sessions();
  session.set_destination(1);
  session.set_kind(proto::SHARING_KIND_SYNC);
  session.set_is_open(true);
  session.set_seconds_since_progress(120);
  EXPECT_THAT(Of(2), ElementsAre("sync to rover1 has made no progress for 2 min"));
  session.set_waits_for("rover1 drives");
  EXPECT_THAT(Of(2), IsEmpty());
  reports_[2].shares->set_rejected_records(3);
  reports_[2].shares->add_other_config_agents(1);
  EXPECT_THAT(Of(2), ElementsAre("refused 3 records of peers", "rover1 has another team file"));
}

TEST_F(HealthTest, AsksForAnOperatorsDecisionAfterAThousandChanges) {
  for (const std::uint64_t number : {TermNumber(3, 999), TermNumber(3, 1000)}) {
    for (const AgentId agent : {AgentId{1}, AgentId{2}}) {
      Status(agent).mutable_roles()->mutable_term()->set_number(number);
      Status(agent).mutable_roles()->set_signature("signed");
    }
    if (number == TermNumber(3, 999)) {
      EXPECT_THAT(Of(2), IsEmpty());
    }
  }
  EXPECT_THAT(Of(2), ElementsAre("the roles changed 1000 times since the last operator command, and joining agents "
                                 "fetch every change: run moonctl role set once"));
}

TEST_F(HealthTest, FindsARemovedAgentWithARole) {
  team_.mutable_agents(0)->set_left(true);
  reports_.erase(1);
  Status(2).clear_peers();
  EXPECT_THAT(
      Of(2),
      ElementsAre("rover1 is leader in term 4, but has left the team: name another agent with moonctl role set"));
  Status(2).mutable_roles()->set_leader(2);
  Status(2).mutable_roles()->set_survivor(1);
  EXPECT_THAT(
      Of(2),
      ElementsAre("rover1 is survivor in term 4, but has left the team: name another agent with moonctl role set"));
}

TEST_F(HealthTest, FindsRecordsThatOneDiskAloneHolds) {
  team_.mutable_at_risk()->set_records(100);
  team_.mutable_at_risk()->set_age_s(3600);
  proto::OneCopy& one_copy = *Status(2).mutable_storage()->mutable_one_copy();
  one_copy.set_count(100);
  one_copy.set_age_s(3600);
  EXPECT_THAT(Of(2), IsEmpty());
  one_copy.set_count(101);
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("no other agent is known to hold 101 records, the oldest for ")));
  one_copy.set_count(1);
  one_copy.set_age_s(7200);
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("no other agent is known to hold 1 record, ")));
  one_copy.set_count(0);
  EXPECT_THAT(Of(2), IsEmpty());
  team_.clear_at_risk();
  one_copy.set_count(1e9);
  EXPECT_THAT(Of(2), IsEmpty()) << "0 is no limit";
}

TEST_F(HealthTest, FindsAgentsWhoseMapsOfOtherRoversAreOld) {
  constexpr std::int64_t kSecond_ns = 1'000'000'000;
  const auto add = [this](std::uint32_t agent, std::uint32_t origin, std::int64_t first_s, std::int64_t last_s) {
    proto::MapTimes& times = *Status(agent).mutable_storage()->add_map_times();
    times.set_origin_agent(origin);
    times.set_first_ns(first_s * kSecond_ns);
    times.set_last_ns(last_s * kSecond_ns);
    return &times;
  };
  team_.mutable_map()->set_team_map_age_s(600);
  add(1, 1, 1000, 2000);
  add(1, 2, 1000, 2000);  // Its own maps are not rover2's to fetch.
  EXPECT_THAT(Of(2), IsEmpty()) << "no policy brings it maps of others";
  (*team_.mutable_rovers())["local_traversability_map"] = proto::POLICY_ALL;
  EXPECT_THAT(
      Of(2),
      ElementsAre(HasSubstr("holds no map of rover1, but the leader holds maps of that rover over a span of 17 min")));
  proto::MapTimes& held = *add(2, 1, 1000, 1399);
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("its newest map of rover1 is older than the leader's by 10 min")));
  held.set_last_ns(1400 * kSecond_ns);
  EXPECT_THAT(Of(2), IsEmpty());
  held.set_last_ns(1399 * kSecond_ns);
  reports_[1].map_stats.emplace().add_unplaced()->set_agent_id(1);
  EXPECT_THAT(Of(2), Not(testing::Contains(HasSubstr("older than the leader's")))) << "not part of the team's map";
  reports_[1].map_stats.reset();
  held.set_last_ns(0);
  EXPECT_THAT(Of(2), IsEmpty()) << "a timestamp of a suspect clock gives no age";
  held.set_last_ns(1399 * kSecond_ns);
  team_.mutable_map()->set_team_map_age_s(0);
  EXPECT_THAT(Of(2), IsEmpty()) << "0 is no limit";
}

TEST_F(HealthTest, FindsARobotWithoutARightClock) {
  proto::SuspectTimestamp& suspect = *Status(2).mutable_storage()->mutable_suspect_timestamp();
  suspect.set_data_type(1);
  suspect.set_timestamp_ns(12'000'000'000);
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("temperature has the timestamp 1970-01-01 00:00:12 UTC")));
  EXPECT_THAT(Of(1), IsEmpty());
}

TEST_F(HealthTest, FindsRoversThatAreNotPlaced) {
  proto::MapStatsReply& stats = reports_[1].map_stats.emplace();
  stats.add_unplaced()->set_agent_id(2);
  stats.mutable_unplaced(0)->set_map_count(40);
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("not placed, 40 maps excluded from the team's map: give it a start")));
  EXPECT_THAT(Of(1), IsEmpty());
  stats.clear_unplaced();
  stats.set_frame_of(1);
  EXPECT_THAT(Of(1), ElementsAre(HasSubstr("not placed in the team's map")));
}

TEST_F(HealthTest, SaysHowFarTheSearchForARoverCame) {
  proto::MapStatsReply& stats = reports_[1].map_stats.emplace();
  stats.add_unplaced()->set_agent_id(2);
  stats.mutable_unplaced(0)->set_map_count(40);
  proto::RegistrationReply& matches = reports_[1].registration.emplace();
  for (const double evidence : {3.0, 12.9}) {
    proto::SearchedStart& start = *matches.add_starts();
    start.set_agent_id(evidence < 5 ? 2 : 1);
    start.set_other_agent_id(evidence < 5 ? 3 : 2);
    start.set_evidence(evidence);
    start.set_rival(10.8);
    start.set_matched(0.974);
    start.set_text(evidence < 5 ? "too little looks alike" : "another place fits nearly as well");
    start.set_remedy("drive one of them on");
  }
  EXPECT_THAT(
      Of(2), ElementsAre("not placed, 40 maps excluded from the team's map; its maps compared with those of rover1: "
                         "another place fits nearly as well (evidence 12.9, best alternative 10.8, matched 97 "
                         "%, contradicted 0 %); drive one of them on, or set its start pose (start in the team file)"));
}

TEST_F(HealthTest, NamesARoverWhoseStartTheMapsContradict) {
  proto::RegistrationReply& matches = reports_[1].registration.emplace();
  const auto add = [&](AgentId a, AgentId b, bool is_contradicted) {
    proto::MatchedAgents& agents = *matches.add_agents();
    agents.set_agent_id(a);
    agents.set_other_agent_id(b);
    proto::RegistrationCount& count = *agents.add_counts();
    count.set_verdict(is_contradicted ? "second place" : "accepted");
    count.set_count(30);
    if (!is_contradicted) return;
    agents.mutable_places()->set_is_contradicted(true);
    agents.mutable_places()->set_contradicted(0.42);
    agents.mutable_places()->set_own_contradicted(0.02);
  };
  add(1, 2, true);
  EXPECT_THAT(Of(1), ElementsAre(HasSubstr("its maps contradict those of rover2 (42 % of the common hazards; 2 % "
                                           "within one rover's own maps): check its start in the team file; ")));
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("its maps contradict those of rover1 (42 %")));
  add(1, 3, false);
  EXPECT_THAT(Of(1), IsEmpty()) << "rover3's maps agree with it";
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("its maps contradict those of rover1 (42 %")));
}

TEST_F(HealthTest, FindsStartsInOnePlace) {
  for (const double side_m : {0.75, 0.5}) team_.mutable_map()->add_footprint_m(side_m);
  for (proto::AgentConfig& agent : *team_.mutable_agents()) agent.mutable_start()->set_x(1);
  EXPECT_THAT(Of(2), ElementsAre(HasSubstr("the start of rover2 lies within one footprint of the start of rover1")));
  team_.mutable_agents(1)->mutable_start()->set_x(2);
  EXPECT_THAT(Of(2), IsEmpty());
}

TEST_F(HealthTest, FindsMapsThatTakeTheOthersHazardsAwayAndSaysHowToRepair) {
  proto::ClearedHazards& cleared = *reports_[1].map_stats.emplace().add_cleared();
  cleared.set_agent_id(2);
  cleared.set_cell_count(900);
  cleared.set_hazard_count(1000);
  cleared.set_from_ns(1'795'000'000'000'000'000);
  cleared.set_to_ns(1'795'000'030'000'000'000);
  cleared.set_x_m(1.25);
  EXPECT_THAT(
      Of(2),
      ElementsAre("within one minute, its maps marked as free 900 of the 1000 cells that other agents hold as hazards: "
                  "'moonctl map why 1.25 0.00' explains one of the cells; if the maps are wrong: moonctl map "
                  "quarantine --agent rover2 "
                  "--from 2026-11-18T11:06:40Z --to 2026-11-18T11:07:10Z"));
}

}  // namespace
}  // namespace moondb
