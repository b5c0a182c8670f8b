// Tests the simulator's invariants directly, including cases that few seeds reach.
#include "apps/moondb_sim/invariants.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

proto::Record PoseOf(std::uint64_t node, std::uint64_t term, std::uint64_t run, double x) {
  proto::Record record;
  proto::OptimizedPose& pose = *record.mutable_optimized_pose();
  pose.mutable_node()->set_agent_id(1);
  pose.mutable_node()->set_index(node);
  pose.mutable_term()->set_number(term);
  pose.set_run(run);
  pose.mutable_map_from_node()->mutable_position_m()->set_x(x);
  return record;
}

proto::Record State() {
  proto::Record record;
  record.mutable_power()->set_battery_ratio(0.5);
  return record;
}

RecordKey Key(AgentId origin, std::uint64_t epoch, DataType type, std::uint64_t seq) {
  return {{origin, epoch, type}, seq};
}

HaveSet Have(const std::vector<RecordKey>& held, const std::vector<RecordKey>& dropped = {}) {
  HaveSet have;
  for (const RecordKey& key : held) have[key.stream].held.Add(key.seq);
  for (const RecordKey& key : dropped) have[key.stream].dropped.Add(key.seq);
  return have;
}

class RulesTest : public testing::Test {
 protected:
  void Insert(AgentId agent, const RecordKey& key, const proto::Record& record) {
    rules_.ObserveInserted(agent, key, record);
    rules_.ObserveRecord(key, record.SerializeAsString(), agent);
  }

  // Checks an idle team of leader 1, survivor 2 and base station 3 with these have-sets. Each agent stores exactly the
  // records that it holds.
  void Rest(const HaveSet& leaders, const HaveSet& survivors, const HaveSet& bases) {
    QuiescentTeam team{1, 2, 3, {{1, leaders}, {2, survivors}, {3, bases}}, {}};
    for (const auto& [agent, have] : team.have) {
      team.records[agent];
      for (const auto& [stream, seqs] : have.streams()) {
        for (const IntervalSet::Interval& interval : seqs.held.intervals()) {
          for (std::uint64_t seq = interval.first; seq <= interval.last; ++seq) team.records[agent][{stream, seq}];
        }
      }
    }
    rules_.CheckQuiescent(team);
  }

  std::vector<std::string> broken_;
  Invariants rules_{[this](const std::string& rule, const std::string&) { broken_.push_back(rule); }};
};

TEST_F(RulesTest, RecordIsWhatItsRobotInserted) {
  const RecordKey key = Key(1, 5, proto::POWER, 1);
  Insert(1, key, State());
  proto::Record marked = State();
  marked.set_is_clock_suspect(true);
  rules_.ObserveRecord(Key(1, 5, proto::POWER, 2), marked.SerializeAsString(), 2);
  rules_.ObserveInserted(1, Key(1, 5, proto::POWER, 2), State());
  EXPECT_THAT(broken_, IsEmpty());
  rules_.ObserveRecord(Key(1, 5, proto::POWER, 3), "other", 2);
  rules_.ObserveInserted(1, Key(1, 5, proto::POWER, 3), State());
  EXPECT_THAT(broken_, ElementsAre("one_content"));
  rules_.ObserveRecord(key, marked.SerializeAsString(), 2);
  EXPECT_THAT(broken_, ElementsAre("one_content", "one_content"));
}

TEST_F(RulesTest, PoseOfAnOlderVersionMayNotReplaceANewerOne) {
  const RecordKey old_pose = Key(1, 5, proto::OPTIMIZED_POSE, 1);
  const RecordKey new_pose = Key(2, 5, proto::OPTIMIZED_POSE, 1);
  Insert(1, old_pose, PoseOf(9, 1, 4, 0));
  Insert(2, new_pose, PoseOf(9, 2, 1, 0));
  rules_.CheckHave(3, Have({old_pose}));
  rules_.CheckHave(3, Have({old_pose, new_pose}));
  EXPECT_THAT(broken_, IsEmpty());
  rules_.CheckHave(3, Have({old_pose}, {new_pose}));
  EXPECT_THAT(broken_, ElementsAre("pose_goes_up"));
}

TEST_F(RulesTest, TwoPosesOfOneRunAreNoticed) {
  Insert(1, Key(1, 5, proto::OPTIMIZED_POSE, 1), PoseOf(9, 1, 4, 0));
  Insert(1, Key(1, 5, proto::OPTIMIZED_POSE, 2), PoseOf(9, 1, 5, 1));
  EXPECT_THAT(broken_, IsEmpty());
  Insert(1, Key(1, 5, proto::OPTIMIZED_POSE, 3), PoseOf(9, 1, 5, 2));
  EXPECT_THAT(broken_, ElementsAre("one_pose_a_run"));
}

TEST_F(RulesTest, LeaderNeedsTheLastStateThatAnyDiskHas) {
  const RecordKey first = Key(1, 5, proto::POWER, 1);
  const RecordKey second = Key(1, 5, proto::POWER, 2);
  Insert(1, first, State());
  Insert(1, second, State());
  rules_.ObserveHave(2, Have({second}, {first}));
  const HaveSet all = Have({second}, {first});
  Rest(all, all, all);
  EXPECT_THAT(broken_, IsEmpty());
  const HaveSet old = Have({first});
  rules_.ForgetDisk(1);
  Rest(old, old, old);
  EXPECT_THAT(broken_, testing::Contains("newest_state")) << "agent 2 had it";
  broken_.clear();
  for (const AgentId agent : {1, 2, 3}) rules_.ForgetDisk(agent);
  Rest(old, old, old);
  EXPECT_THAT(broken_, IsEmpty()) << "it is lost with its disks";
}

TEST_F(RulesTest, InAnIdleTeamEachAgentHoldsItsRequiredRecords) {
  const HaveSet node = Have({Key(3, 5, proto::POSE_GRAPH_NODE, 1)});
  Rest(node, node, node);
  EXPECT_THAT(broken_, IsEmpty());
  Rest(node, node, HaveSet());
  EXPECT_THAT(broken_, testing::UnorderedElementsAre("home_again", "brought_out"));
  broken_.clear();
  Rest(node, HaveSet(), node);
  EXPECT_THAT(broken_, ElementsAre("survivor_is_leader"));
  broken_.clear();
  Insert(3, Key(3, 5, proto::POSE_GRAPH_NODE, 1), proto::Record());
  Rest(HaveSet(), HaveSet(), node);
  EXPECT_THAT(broken_, ElementsAre("nothing_lost"));
}

TEST_F(RulesTest, AMapMatchReplacesOlderOnesWithTheSameEnds) {
  const auto match_to = [](std::uint64_t index) {
    proto::Record record;
    record.mutable_map_match()->mutable_from()->set_agent_id(1);
    record.mutable_map_match()->mutable_to()->set_agent_id(2);
    record.mutable_map_match()->mutable_to()->set_index(index);
    return record;
  };
  const RecordKey older = Key(1, 5, proto::MAP_MATCH, 1);
  const RecordKey newer = Key(1, 5, proto::MAP_MATCH, 2);
  const RecordKey other = Key(1, 5, proto::MAP_MATCH, 3);
  Insert(1, older, match_to(7));
  Insert(1, newer, match_to(7));
  Insert(1, other, match_to(8));
  EXPECT_TRUE(rules_.IsReplacedIn(Have({newer}), older));
  EXPECT_FALSE(rules_.IsReplacedIn(Have({older}), newer));
  EXPECT_FALSE(rules_.IsReplacedIn(Have({other}), older)) << "of other ends";
}

TEST_F(RulesTest, AnEventShortBeforeTheEndNeedNotReachTheSurvivor) {
  proto::Record event;
  event.mutable_agent_event()->set_kind(proto::EVENT_KIND_REJECTED);
  const RecordKey early = Key(1, 7, proto::AGENT_EVENT, 1);
  const RecordKey late = Key(1, 7, proto::AGENT_EVENT, 2);
  Insert(1, early, event);
  Insert(1, late, event);
  rules_.ExcuseLate(late);
  Rest(Have({early, late}), Have({early}), Have({early}));
  EXPECT_THAT(broken_, IsEmpty());
  Rest(Have({early, late}), Have({}), Have({early}));
  EXPECT_THAT(broken_, ElementsAre("survivor_is_leader")) << "an earlier one has to";
}

TEST_F(RulesTest, AHaveSetMatchesTheStoredRows) {
  const HaveSet node = Have({Key(1, 5, proto::POSE_GRAPH_NODE, 1)});
  QuiescentTeam team{1, 2, 3, {{1, node}, {2, node}, {3, node}}, {{1, {}}, {2, {}}, {3, {}}}};
  rules_.CheckQuiescent(team);
  EXPECT_THAT(broken_, testing::Each("acknowledged_held"));
  EXPECT_EQ(broken_.size(), 3u);
}

TEST_F(RulesTest, WhatIsPrunedIsOwedToNobodyUnlessSomebodyHoldsIt) {
  const RecordKey key = Key(2, 5, proto::POSE_GRAPH_NODE, 1);
  Insert(2, key, {});
  Rest(Have({}, {key}), Have({key}), Have({}, {key}));
  Rest(Have({key}), Have({}, {key}), Have({}, {key}));
  Rest(Have({}), Have({}, {key}), Have({}, {key}));  // The leader's disk was lost, and no other agent holds the record.
  EXPECT_THAT(broken_, IsEmpty());
  Rest(Have({}), Have({}, {key}), Have({key}));
  EXPECT_THAT(broken_, ElementsAre("nothing_lost"));
}

TEST_F(RulesTest, StateIsDroppedForANewerOneOnly) {
  rules_.CheckHave(3, Have({Key(1, 6, proto::POWER, 1)}, {Key(1, 5, proto::POWER, 7)}));
  EXPECT_THAT(broken_, IsEmpty());
  rules_.CheckHave(3, Have({Key(1, 5, proto::POWER, 6)}, {Key(1, 5, proto::POWER, 7)}));
  EXPECT_THAT(broken_, ElementsAre("newest_state"));
}

TEST_F(RulesTest, KeptNotesAreHeldByLeaderAndSurvivorUnlessTheirDisksAreLost) {
  for (std::uint64_t seq = 1; seq <= 2; ++seq) Insert(3, Key(3, 5, kNote, seq), proto::Record());
  rules_.ObserveKept(Key(3, 5, kNote, 2));
  const HaveSet both = Have({Key(3, 5, kNote, 1), Key(3, 5, kNote, 2)});
  const HaveSet first = Have({Key(3, 5, kNote, 1)}, {Key(3, 5, kNote, 2)});
  const HaveSet second = Have({Key(3, 5, kNote, 2)}, {Key(3, 5, kNote, 1)});
  Rest(both, second, both);
  EXPECT_THAT(broken_, IsEmpty()) << "the first one was superseded under the old policy";
  Rest(both, first, both);
  EXPECT_THAT(broken_, ElementsAre("notes_kept"));
  rules_.ForgetDisk(1);
  rules_.ForgetDisk(2);
  rules_.ForgetDisk(3);
  broken_.clear();
  Rest({}, {}, {});
  EXPECT_THAT(broken_, IsEmpty());
}

TEST_F(RulesTest, DamagedRecordIsForgottenAndNothingElse) {
  const DataType node = proto::POSE_GRAPH_NODE;
  for (std::uint64_t seq = 1; seq <= 3; ++seq) Insert(1, Key(1, 5, node, seq), proto::Record());
  rules_.ObserveHave(2, Have({Key(1, 5, node, 1)}));
  rules_.ForgetRecord(1, Key(1, 5, node, 1));
  rules_.ForgetRecord(1, Key(1, 5, node, 2));
  rules_.CheckHave(1, Have({Key(1, 5, node, 3)}));
  EXPECT_THAT(broken_, IsEmpty());
  rules_.CheckHave(1, HaveSet());
  EXPECT_THAT(broken_, ElementsAre("acknowledged_held"));
}

TEST_F(RulesTest, DamagedRecordIsOwedWhereAnotherDiskHasIt) {
  const DataType node = proto::POSE_GRAPH_NODE;
  for (std::uint64_t seq = 1; seq <= 2; ++seq) Insert(1, Key(1, 5, node, seq), proto::Record());
  rules_.ObserveHave(2, Have({Key(1, 5, node, 1)}));
  for (std::uint64_t seq = 1; seq <= 2; ++seq) rules_.ForgetRecord(1, Key(1, 5, node, seq));
  const HaveSet first = Have({Key(1, 5, node, 1)});
  Rest(first, first, first);
  EXPECT_THAT(broken_, IsEmpty()) << "of the second nobody has a copy";
  Rest(HaveSet(), HaveSet(), HaveSet());
  EXPECT_THAT(broken_, testing::Contains("nothing_lost"));
}

TEST_F(RulesTest, DamagedStateTakesThoseThatItReplacedWithIt) {
  const RecordKey first = Key(1, 5, proto::POWER, 1);
  const RecordKey second = Key(1, 5, proto::POWER, 2);
  Insert(1, first, State());
  rules_.ForgetRecord(1, second);  // No other agent received the record `second`.
  rules_.CheckHave(1, HaveSet());
  EXPECT_THAT(broken_, IsEmpty());
}

}  // namespace
}  // namespace moondb::simulation
