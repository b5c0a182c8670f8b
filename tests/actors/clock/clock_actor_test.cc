// Checks which records StorageActor marks with is_clock_suspect after an agent's clock jumps.
#include "actors/clock/clock_actor.h"

#include <gtest/gtest.h>

#include "actors/storage/storage_actor.h"
#include "model/control_message.h"
#include "model/geometry.h"
#include "proto/control.pb.h"
#include "runtime/simulation/simulated_team.h"

namespace moondb {
namespace {

using std::chrono::hours;
using std::chrono::seconds;

class ClockActorTest : public testing::Test {
 protected:
  ClockActorTest() {
    for (AgentId id = 1; id <= 3; ++id) {
      proto::AgentConfig& agent = *config_.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
    }
    (*config_.mutable_share())["temperature"] = proto::POLICY_ALL;
    for (AgentId id = 1; id <= 3; ++id) {
      team_.AddAgent(id);
      StorageActor::Options storage;
      storage.path = ":memory:";
      storage.self = id;
      storage.team = config_;
      team_.Spawn(id, actor_name::kStorage, [storage] { return std::make_unique<StorageActor>(storage); });
      ClockActor::Options clock;
      clock.self = id;
      clock.team = config_;
      team_.Spawn(id, actor_name::kClock, [clock] { return std::make_unique<ClockActor>(clock); });
    }
  }

  proto::Message Ask(AgentId agent, proto::Message question) {
    (void)team_.Post({agent, "test"}, {agent, actor_name::kStorage}, std::move(question));
    team_.RunUntilIdle();
    const std::vector<proto::Message> replies = team_.TakeMessages({agent, "test"});
    EXPECT_EQ(replies.size(), 1u);
    return replies.empty() ? proto::Message() : replies[0];
  }

  // Returns is_clock_suspect of each record at `agent`, in insertion order.
  std::vector<bool> Marked(AgentId agent) {
    proto::Message question;
    question.mutable_read_request();
    const proto::Message answer = Ask(agent, std::move(question));
    std::vector<bool> marked;
    for (const proto::StoredRecord& stored : answer.read_reply().records()) {
      proto::Record record;
      EXPECT_TRUE(record.ParseFromString(stored.content()));
      marked.push_back(record.is_clock_suspect());
    }
    return marked;
  }

  void Insert(AgentId agent) {
    proto::Message message;
    proto::Record& record = *message.mutable_insert_request()->add_records();
    record.set_timestamp_ns(1'767'225'600'000'000'000);  // 2026-01-01.
    record.mutable_temperature()->set_celsius(1);
    EXPECT_FALSE(Ask(agent, std::move(message)).insert_reply().has_error());
  }

  std::string SuspectOf(AgentId agent) {
    proto::ControlRequest question;
    question.mutable_status();
    const auto answer = ControlReplyOf(Ask(agent, MessageOf(question)));
    EXPECT_TRUE(answer);
    return answer ? answer->status().storage().clock_suspect() : "";
  }

  proto::TeamConfig config_;
  simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(ClockActorTest, MarksRecordsInsertedWhileItsClockIsOffTheTeams) {
  team_.AdvanceTime(seconds(1));
  Insert(2);
  EXPECT_EQ(SuspectOf(2), "");
  team_.SetUtcOffset(2, hours(5));
  Insert(2);
  EXPECT_EQ(SuspectOf(2), "it is more than a minute off the clocks of 2 other agents");
  team_.SetUtcOffset(2, -hours(24 * 365 * 56));  // The clock shows the year 1970.
  Insert(2);
  EXPECT_EQ(SuspectOf(2), "it was never set");
  team_.SetUtcOffset(2, seconds(3));
  Insert(2);
  EXPECT_EQ(SuspectOf(2), "");
  EXPECT_EQ(Marked(2), std::vector<bool>({false, true, true, false}));
  Insert(1);
  EXPECT_EQ(Marked(1), std::vector<bool>({false})) << "the others' clocks are right";
}

TEST_F(ClockActorTest, ReportsAClockJumpToPeers) {
  team_.AdvanceTime(seconds(1));
  for (AgentId agent = 1; agent <= 3; ++agent) {
    team_.SetUtcOffset(agent, hours(5));
    Insert(agent);
  }
  team_.AdvanceTime(seconds(1));
  for (AgentId agent = 1; agent <= 3; ++agent) EXPECT_EQ(SuspectOf(agent), "") << "all agree again";
}

TEST_F(ClockActorTest, IsSilentBetweenChanges) {
  team_.AdvanceTime(seconds(1));
  const std::uint64_t bytes = team_.radio_bytes();
  for (int i = 0; i < 100; ++i) Insert(1);
  team_.AdvanceTime(hours(10));
  EXPECT_EQ(team_.radio_bytes(), bytes);
}

TEST_F(ClockActorTest, ANodeInsertedAgainUnderAnotherVerdictKeepsItsKey) {
  proto::Message message;
  proto::PoseGraphNode& node = *message.mutable_insert_request()->add_records()->mutable_pose_graph_node();
  *node.mutable_node() = ToProto(NodeKey{2, 7});
  *node.mutable_map_from_node() = ToProto(Pose());
  const proto::InsertReply first = Ask(2, message).insert_reply();
  team_.SetUtcOffset(2, hours(5));
  const proto::InsertReply again = Ask(2, message).insert_reply();
  EXPECT_FALSE(again.has_error()) << again.error().text();
  EXPECT_EQ(again.keys(0).seq(), first.keys(0).seq());
}

TEST_F(ClockActorTest, AcceptsReportsOnlyFromTheTeam) {
  proto::Message report;
  report.mutable_clock_report()->set_utc_ns(1);
  (void)team_.Post({9, "clock"}, {2, actor_name::kClock}, report);
  proto::Message forged;
  forged.mutable_peer_clock()->set_peer(3);
  (void)team_.Post({3, "clock"}, {2, actor_name::kClock}, forged);
  team_.RunUntilIdle();
  EXPECT_EQ(SuspectOf(2), "");
}

}  // namespace
}  // namespace moondb
