#include "apps/moonctl/share_status.h"

#include <gmock/gmock.h>

namespace moondb {
namespace {

using testing::ElementsAre;

proto::TeamConfig TeamOfTwo() {
  proto::TeamConfig team;
  for (const std::uint32_t id : {1, 2}) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(id);
    agent.set_name("rover" + std::to_string(id));
  }
  return team;
}

proto::ShareSession Sending() {
  proto::ShareSession session;
  session.set_destination(1);
  session.set_is_open(true);
  session.set_sent_records(1240);
  session.set_acknowledged_records(1200);  // 1000 of them were acknowledged in earlier sessions.
  session.set_is_remaining_known(true);
  session.set_remaining(500);
  session.set_coded_bytes(3e6);
  session.set_session_s(10);
  session.set_session_acknowledged_records(200);
  session.set_session_acknowledged_bytes(1.2e6);
  session.set_seconds_since_progress(0.3);
  session.set_resends(2);
  session.set_completed_sessions(4);
  return session;
}

TEST(ShareStatusTest, EstimatesFromRecordsAcknowledgedInThisSession) {
  const SharePace pace = PaceOf(Sending());
  EXPECT_EQ(pace.bytes_per_s, 120'000);
  EXPECT_EQ(pace.eta_s, 25);
}

TEST(ShareStatusTest, MakesNoEstimateWithoutData) {
  proto::ShareSession session = Sending();
  session.set_session_acknowledged_records(0);
  EXPECT_EQ(PaceOf(session).bytes_per_s, std::nullopt);
  EXPECT_EQ(PaceOf(session).eta_s, std::nullopt);

  session = Sending();
  session.set_session_s(0);  // The session is closed, or the receiver did not answer.
  EXPECT_EQ(PaceOf(session).bytes_per_s, std::nullopt);
  EXPECT_EQ(PaceOf(session).eta_s, std::nullopt);

  session = Sending();
  session.set_is_remaining_known(false);
  EXPECT_EQ(PaceOf(session).bytes_per_s, 120'000);
  EXPECT_EQ(PaceOf(session).eta_s, std::nullopt);
}

TEST(ShareStatusTest, ShowsASessionInARow) {
  EXPECT_EQ(ShareStatusHeader().size(), ShareStatusRow(TeamOfTwo(), "rover2", Sending(), 500).size());
  EXPECT_THAT(ShareStatusRow(TeamOfTwo(), "rover2", Sending(), 500),
              ElementsAre("rover2", "rover1", "sending", "1240", "1200", "500", "3.0 MB", "120.0 kB/s", "25 s", "0 s",
                          "2", "4", "-", ""));
}

TEST(ShareStatusTest, ShowsUnknownValuesAsUnknown) {
  proto::ShareSession waiting;
  waiting.set_destination(1);
  waiting.set_is_open(true);
  waiting.set_seconds_since_progress(7200);
  waiting.set_last_error("sending to rover1: unreachable");
  EXPECT_THAT(ShareStatusRow(TeamOfTwo(), "rover2", waiting, std::nullopt),
              ElementsAre("rover2", "rover1", "waiting", "0", "0", "-", "0 B", "-", "-", "2.0 h", "0", "0", "-",
                          "sending to rover1: unreachable"));
  proto::ShareSession idle = Sending();
  idle.set_is_open(false);
  idle.set_session_s(0);
  idle.set_seconds_since_end(1500);
  const auto row = ShareStatusRow(TeamOfTwo(), "rover2", idle, 0);
  EXPECT_EQ(row[2], "idle");
  EXPECT_EQ(row[5], "0");
  EXPECT_EQ(row[8], "-");
  EXPECT_EQ(row[12], "25 min ago");
}

// The last session says nothing about what was inserted after it.
TEST(ShareStatusTest, CountsWhatIsLeftFromTheStore) {
  proto::AgentStatus status;
  status.mutable_roles()->set_leader(1);
  proto::PeerBacklog& backlog = *status.mutable_storage()->add_backlogs();
  backlog.set_agent_id(1);
  backlog.set_own_count(45);
  backlog.set_all_count(60);
  proto::ShareSession session = Sending();
  EXPECT_EQ(LeftOf(&status, session), 500) << "an open session knows more";
  session.set_is_open(false);
  session.set_remaining(0);
  EXPECT_EQ(LeftOf(&status, session), 45);
  session.set_kind(proto::SHARING_KIND_REPLICATION);
  EXPECT_EQ(LeftOf(&status, session), 60);
  session.set_kind(proto::SHARING_KIND_SYNC);
  session.set_destination(2);
  EXPECT_EQ(LeftOf(&status, session), std::nullopt) << "a leader's records to a rover";
  EXPECT_EQ(LeftOf(nullptr, session), std::nullopt);
}

}  // namespace
}  // namespace moondb
