// Runs EventActor and StorageActor together. Checks the findings, which an operator sees until they are acknowledged.
#include <gmock/gmock.h>

#include "actors/event/event_actor.h"
#include "actors/storage/storage_actor.h"
#include "model/control_message.h"
#include "model/event.h"
#include "proto/control.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Agent 1 runs StorageActor and EventActor. Agents 2 and 3 run no actors; the tests only connect and disconnect them.
// The function Minutes takes the place of agent 1's lease actor.
class FindingsTest : public testing::Test {
 protected:
  FindingsTest() {
    StorageActor::Options storage;
    storage.path = folder_.File("a.db");
    storage.self = 1;
    for (const std::uint32_t id : {1, 2, 3}) {
      proto::AgentConfig& agent = *storage.team.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
      team_.AddAgent(id);
    }
    (*storage.team.mutable_share())["agent_event"] = proto::POLICY_ALL;
    storage.team.mutable_radio()->set_quiet_while_driving(true);
    EventActor::Options events;
    events.self = 1;
    events.team = storage.team;
    team_.Spawn(1, actor_name::kStorage, [storage] { return std::make_unique<StorageActor>(storage); });
    team_.Spawn(1, actor_name::kEvent, [events] { return std::make_unique<EventActor>(events); });
    team_.RunUntilIdle();
  }

  void Minutes(int count) {
    for (int i = 0; i < count; ++i) {
      proto::Message message;
      *message.mutable_leases_changed() = leases_;
      message.mutable_leases_changed()->set_as_of_ns(team_.now().time_since_epoch().count());
      (void)team_.Post({1, actor_name::kLease}, {1, actor_name::kEvent}, message);
      team_.AdvanceTime(minutes(1));
    }
  }

  proto::ControlReply Ask(const proto::ControlRequest& question) {
    (void)team_.Post({1, "requester"}, {1, actor_name::kEvent}, MessageOf(question));
    team_.RunUntilIdle();
    const auto answers = team_.TakeMessages({1, "requester"});
    EXPECT_EQ(answers.size(), 1u);
    const auto reply = ControlReplyOf(answers.empty() ? proto::Message() : answers.front());
    EXPECT_TRUE(reply);
    return reply ? *reply : proto::ControlReply();
  }

  std::vector<proto::HealthFinding> Findings() {
    proto::ControlRequest question;
    question.mutable_status();
    const proto::ControlReply answer = Ask(question);
    return {answer.status().findings().begin(), answer.status().findings().end()};
  }

  std::vector<std::string> Texts() {
    std::vector<std::string> texts;
    const std::vector<proto::HealthFinding> findings = Findings();
    for (const proto::HealthFinding& finding : findings) texts.push_back(finding.text());
    return texts;
  }

  proto::AcknowledgeReply Acknowledge(std::int64_t until_ns) {
    proto::ControlRequest question;
    question.mutable_acknowledge()->set_until_ns(until_ns);
    return Ask(question).acknowledge();
  }

  // Returns the texts of all events in storage.
  std::vector<std::string> Story() {
    proto::Message question;
    question.mutable_read_request();
    (void)team_.Post({1, "reader"}, {1, actor_name::kStorage}, question);
    team_.RunUntilIdle();
    std::vector<std::string> texts;
    for (const proto::Message& answer : team_.TakeMessages({1, "reader"})) {
      for (const proto::StoredRecord& stored : answer.read_reply().records()) {
        proto::Record record;
        EXPECT_TRUE(record.ParseFromString(stored.content()));
        texts.push_back(record.agent_event().text());
      }
    }
    return texts;
  }

  proto::AgentLease& Lease(AgentId agent) {
    proto::AgentLease& lease = *leases_.add_leases();
    lease.set_agent_id(agent);
    return lease;
  }

  const TemporaryFolder folder_;
  proto::LeasesChanged leases_;
  simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(FindingsTest, ReportAPeerThatIsAwayForAMinuteOnce) {
  Minutes(3);
  EXPECT_THAT(Texts(), IsEmpty());
  const std::int64_t lost_ns = team_.utc_now_ns();
  team_.SetLink(1, 2, false);
  Minutes(5);
  ASSERT_THAT(Texts(), ElementsAre("rover2 was lost"));
  EXPECT_EQ(Findings()[0].timestamp_ns(), lost_ns);
  team_.SetLink(1, 2, true);
  Minutes(1);
  EXPECT_THAT(Texts(), ElementsAre("rover2 was lost for 300 s, and is back"));
  EXPECT_THAT(Story(), ElementsAre(HasSubstr("started"), "rover2 was lost", "rover2 was lost for 300 s, and is back"));
}

TEST_F(FindingsTest, DoNotReportABriefLossOfThePeer) {
  for (int i = 0; i < 10; ++i) {
    team_.SetLink(1, 2, false);
    team_.AdvanceTime(seconds(40));
    team_.SetLink(1, 2, true);
    Minutes(1);
  }
  EXPECT_THAT(Texts(), IsEmpty());
  EXPECT_EQ(Story().size(), 1u);
}

TEST_F(FindingsTest, DoNotReportASleepingOrSilentlyDrivingPeerBeforeItsLeaseExpires) {
  Lease(2).set_sleeping_s(3600);
  Lease(3).set_driving_s(3600);
  team_.SetLink(1, 2, false);
  team_.SetLink(1, 3, false);
  Minutes(20);
  EXPECT_THAT(Texts(), IsEmpty());
  leases_.clear_leases();
  Minutes(1);
  EXPECT_THAT(Texts(), ElementsAre("rover2 was lost", "rover3 was lost"));
}

TEST_F(FindingsTest, DoNotReportLostPeersWhileTheAgentItselfSleeps) {
  Lease(1).set_sleeping_s(3600);
  team_.SetLink(1, 2, false);
  Minutes(20);
  EXPECT_THAT(Texts(), IsEmpty());
}

TEST_F(FindingsTest, DoNotReportAPeerThatWasNeverConnected) {
  team_.SetLink(1, 2, false);
  team_.Crash(1);
  team_.Restart(1);
  Minutes(10);
  EXPECT_THAT(Texts(), IsEmpty());
}

TEST_F(FindingsTest, ReportALinkThatFlapsAllDayInAFewEvents) {
  for (int i = 0; i < 60; ++i) {
    team_.SetLink(1, 2, false);
    Minutes(2);
    team_.SetLink(1, 2, true);
    Minutes(1);
  }
  const auto story = Story();
  EXPECT_LE(story.size(), 2u * 180 / 10 + 2);
  EXPECT_GE(story.size(), 10u);
  EXPECT_THAT(Texts(), ElementsAre(HasSubstr(" times)")));
}

// StorageActor logs damage itself, for example that its disk was replaced.
TEST_F(FindingsTest, ShowAnEventThatAnotherActorLogged) {
  EXPECT_THAT(Texts(), IsEmpty());
  proto::Message insert;
  *insert.mutable_insert_request()->add_records() =
      MakeEvent(proto::EVENT_KIND_DAMAGE, kDiskReplaced, "", team_.utc_now_ns());
  (void)team_.Post({1, "other"}, {1, actor_name::kStorage}, insert);
  team_.RunUntilIdle();
  EXPECT_THAT(Texts(), ElementsAre(kDiskReplaced));
  EXPECT_EQ(Acknowledge(team_.utc_now_ns()).count(), 1u);
  EXPECT_THAT(Texts(), IsEmpty());
}

TEST_F(FindingsTest, StayAcknowledged) {
  team_.SetLink(1, 2, false);
  Minutes(3);
  const auto findings = Findings();
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_EQ(Acknowledge(findings[0].timestamp_ns() - 1).count(), 0u);
  EXPECT_EQ(Texts().size(), 1u);
  const proto::AcknowledgeReply reply = Acknowledge(findings[0].timestamp_ns());
  EXPECT_EQ(reply.count(), 1u) << reply.DebugString();
  EXPECT_THAT(Texts(), IsEmpty());
  EXPECT_EQ(Acknowledge(findings[0].timestamp_ns()).count(), 0u);
  EXPECT_THAT(Story(), testing::Contains(HasSubstr("1 finding was acknowledged")));

  team_.Crash(1);
  team_.Restart(1);
  Minutes(1);
  EXPECT_THAT(Texts(), IsEmpty());
  EXPECT_THAT(Story(), testing::Contains("rover2 was lost")) << "it stays in the log";
}

TEST_F(FindingsTest, SurviveARestartUntilReadAndNameThePeersThatReturned) {
  team_.SetLink(1, 2, false);
  team_.SetLink(1, 3, false);
  Minutes(3);
  team_.Crash(1);
  team_.SetLink(1, 2, true);
  team_.AdvanceTime(minutes(1));
  team_.Restart(1);
  Minutes(1);
  EXPECT_THAT(Texts(), ElementsAre("rover3 was lost", HasSubstr("rover2 was lost for ")));
  EXPECT_THAT(Texts()[1], HasSubstr("and is back"));
  Minutes(5);
  EXPECT_EQ(Texts().size(), 2u);
}

TEST_F(FindingsTest, ReportThatAnAcknowledgmentCouldNotBeStored) {
  team_.SetLink(1, 2, false);
  Minutes(3);
  const auto findings = Findings();
  ASSERT_EQ(findings.size(), 1u);
  // Storage fails before it handles the insert of the acknowledgment. The client gets no reply, and nothing is
  // acknowledged.
  bool has_failed = false;
  team_.SetFault([&](const Address& actor, const proto::Message& message) {
    const bool is_it = actor.actor == actor_name::kStorage && message.has_insert_request() && !has_failed;
    has_failed = has_failed || is_it;
    return is_it ? simulation::Fault::kBeforeHandler : simulation::Fault::kNone;
  });
  proto::ControlRequest question;
  question.mutable_acknowledge()->set_until_ns(findings[0].timestamp_ns());
  (void)team_.Post({1, "requester"}, {1, actor_name::kEvent}, MessageOf(question));
  team_.RunUntilIdle();
  EXPECT_THAT(team_.TakeMessages({1, "requester"}), IsEmpty());
  Minutes(1);
  EXPECT_EQ(Texts().size(), 1u);
  EXPECT_EQ(Acknowledge(findings[0].timestamp_ns()).count(), 1u);
}

}  // namespace
}  // namespace moondb
