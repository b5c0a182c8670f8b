#include "actors/event/event_actor.h"

#include <gmock/gmock.h>

#include "model/control_message.h"
#include "proto/control.pb.h"
#include "runtime/simulation/simulated_team.h"

namespace moondb {
namespace {

using std::chrono::minutes;
using testing::ElementsAre;
using testing::IsEmpty;

// Agent 1 runs only EventActor. The tests send the messages of its other actors, and read the messages that EventActor
// sends to them.
class EventActorTest : public testing::Test {
 protected:
  EventActorTest() {
    EventActor::Options options;
    options.self = 1;
    options.version = "1.2.3";
    for (const std::uint32_t id : {1, 2, 3}) {
      proto::AgentConfig& agent = *options.team.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
    }
    team_.AddAgent(1);
    team_.Spawn(1, actor_name::kEvent, [options] { return std::make_unique<EventActor>(options); });
    team_.RunUntilIdle();
  }

  // Returns the texts of the events that EventActor sent to storage since the last call.
  std::vector<std::string> Notified() {
    std::vector<std::string> texts;
    for (const proto::Message& message : team_.TakeMessages({1, actor_name::kStorage})) {
      if (message.has_insert_request()) texts.push_back(message.insert_request().records(0).agent_event().text());
    }
    return texts;
  }

  void Post(const std::string& actor, const proto::Message& message) {
    ASSERT_EQ(team_.Post({1, actor}, {1, actor_name::kEvent}, message), SendResult::kAccepted);
    team_.RunUntilIdle();
  }

  void Roles(std::uint64_t term, AgentId issuer, AgentId leader, const std::string& reason = "") {
    proto::Message message;
    proto::RoleAssignment& roles = *message.mutable_roles_changed()->mutable_roles();
    roles.mutable_term()->set_number(term);
    roles.mutable_term()->set_issuer(issuer);
    roles.set_leader(leader);
    roles.set_survivor(3);
    roles.set_reason(reason);
    Post(actor_name::kRole, message);
  }

  void Rejected(double count) {
    proto::ControlReply reply;
    reply.mutable_status()->mutable_storage()->set_rejected_count(count);
    Post(actor_name::kStorage, MessageOf(reply));
  }

  simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(EventActorTest, ReportsThatTheAgentStarted) { EXPECT_THAT(Notified(), ElementsAre("started, moondb 1.2.3")); }

class FailingActor final : public Actor {
 public:
  void OnStart(Context& context) override { context.Fail({ErrorCode::kInternal, "fails", {}}); }
  void OnMessage(Context&, const proto::Message&) override {}
};

TEST(EventActorRestartTest, ReportsItsOwnFailure) {
  simulation::SimulatedTeam team(/*seed=*/1);
  team.AddAgent(1);
  bool has_failed = false;
  team.Spawn(1, actor_name::kEvent, [&has_failed]() -> std::unique_ptr<Actor> {
    if (!std::exchange(has_failed, true)) return std::make_unique<FailingActor>();
    EventActor::Options options;
    options.self = 1;
    return std::make_unique<EventActor>(std::move(options));
  });
  team.AdvanceTime(minutes(5));
  std::vector<std::string> texts;
  for (const proto::Message& message : team.TakeMessages({1, actor_name::kStorage})) {
    if (message.has_insert_request()) texts.push_back(message.insert_request().records(0).agent_event().text());
  }
  EXPECT_THAT(texts, ElementsAre("the actor event failed and was restarted (moonctl trace)"));
}

TEST_F(EventActorTest, ReportsRolesThatItsOwnAgentIssuedAfterTheFirst) {
  (void)Notified();
  // EventActor does not report the first roles that it receives, because they date from before its start.
  Roles(3, /*issuer=*/1, /*leader=*/2);
  Roles(4, /*issuer=*/2, /*leader=*/2);
  Roles(5, /*issuer=*/1, /*leader=*/1, "sun is low");
  Roles(5, /*issuer=*/1, /*leader=*/1, "sun is low");
  EXPECT_THAT(Notified(), ElementsAre("rover1 leads, rover3 is the designated survivor, term 5: sun is low"));
}

TEST_F(EventActorTest, ReportsNewlyRefusedRecordsOnceAMinute) {
  (void)Notified();
  // EventActor reports by how many the count of refused records has risen. It reports nothing for the first count.
  Rejected(5);
  EXPECT_THAT(Notified(), IsEmpty());
  Rejected(8);
  EXPECT_THAT(Notified(), ElementsAre("3 records were refused by storage"));
  Rejected(8);
  EXPECT_THAT(Notified(), IsEmpty());
}

TEST_F(EventActorTest, ReportsSessionsThatEndedEarlyAndWhy) {
  (void)Notified();
  proto::ControlReply reply;
  reply.mutable_share_status();
  Post(actor_name::kSync, MessageOf(reply));
  reply.mutable_share_status()->set_damaged_messages(1);
  proto::ShareSession& session = *reply.mutable_share_status()->add_sessions();
  session.set_destination(2);
  session.set_closed_sessions(2);
  session.set_last_error("the roles changed");
  Post(actor_name::kSync, MessageOf(reply));
  EXPECT_THAT(
      Notified(),
      ElementsAre("1 messages from peers were damaged",
                  "2 sharing sessions to rover2 ended before all records were acknowledged: the roles changed"));
  Post(actor_name::kReplica, MessageOf(reply));
  EXPECT_THAT(Notified(), IsEmpty());
}

// The reply of a sharing actor to whose session agent 2 does not take all records.
proto::ControlReply ReplyWithRefusing() {
  proto::ControlReply reply;
  proto::ShareStatus& status = *reply.mutable_share_status();
  proto::ShareSession& session = *status.add_sessions();
  session.set_destination(2);
  session.set_last_error("the destination did not accept 7 records");
  status.add_refusing(2);
  return reply;
}

TEST_F(EventActorTest, ReportsOnceThatAnAgentDoesNotTakeAllRecordsAndOnceThatItDoesAgain) {
  (void)Notified();
  proto::ControlReply reply = ReplyWithRefusing();
  Post(actor_name::kSync, MessageOf(reply));
  EXPECT_THAT(
      Notified(),
      ElementsAre("rover2 does not accept all records; the others wait to be sent again: the destination did not "
                  "accept 7 records"));
  Post(actor_name::kSync, MessageOf(reply));
  EXPECT_THAT(Notified(), IsEmpty());
  reply.mutable_share_status()->clear_refusing();
  reply.mutable_share_status()->mutable_sessions(0)->clear_last_error();
  Post(actor_name::kSync, MessageOf(reply));
  EXPECT_THAT(Notified(), ElementsAre("rover2 accepts records again"));
}

TEST_F(EventActorTest, DoesNotReportThatAFormerDestinationTakesRecordsAgain) {
  proto::ControlReply reply = ReplyWithRefusing();
  Post(actor_name::kSync, MessageOf(reply));
  (void)Notified();
  reply.mutable_share_status()->clear_refusing();
  reply.mutable_share_status()->mutable_sessions(0)->set_last_error("the roles changed");
  Post(actor_name::kSync, MessageOf(reply));
  EXPECT_THAT(Notified(), IsEmpty());
}

TEST_F(EventActorTest, RequestsStatusEveryMinute) {
  const auto asked = [this] {
    std::size_t count = 0;
    for (const proto::Message& message : team_.TakeMessages({1, actor_name::kSync})) {
      const auto request = ControlRequestOf(message);
      count += request && request->has_share_status();
    }
    return count;
  };
  EXPECT_EQ(asked(), 1u);
  team_.AdvanceTime(minutes(10));
  EXPECT_EQ(asked(), 10u);
}

TEST_F(EventActorTest, IgnoresOtherAgents) {
  (void)Notified();
  team_.AddAgent(2);
  proto::ControlReply reply;
  reply.mutable_status()->mutable_storage();
  (void)team_.Post({2, actor_name::kStorage}, {1, actor_name::kEvent}, MessageOf(reply));
  reply.mutable_status()->mutable_storage()->set_rejected_count(7);
  (void)team_.Post({2, actor_name::kStorage}, {1, actor_name::kEvent}, MessageOf(reply));
  team_.AdvanceTime(std::chrono::seconds(1));
  EXPECT_THAT(Notified(), IsEmpty());
}

}  // namespace
}  // namespace moondb
