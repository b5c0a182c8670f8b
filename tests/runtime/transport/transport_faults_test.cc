// Tests how the transport handles failures that libzmq does not handle, in the order of ARCHITECTURE.md: absent,
// frozen, flooding and restarted peers, replaced connections, and peers with wrong or missing reports.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <set>
#include <thread>
#include <vector>

#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "runtime/transport/outbound.h"
#include "tests/runtime/transport/transport_fixture.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;

constexpr std::size_t kCreditBytes = 8 * 1024;

// Agent 1 is a real transport. Each test takes the place of agent 2, with a DEALER that sends arbitrary bytes.
class TransportFaultsTest : public TransportFixture {
 protected:
  TransportFaultsTest() {
    MakeTeam(/*is_insecure=*/true);
    options_.credit = {.bytes_min = kCreditBytes, .bytes_max = kCreditBytes};
  }

  // Sets deadlines short enough for a test.
  void UseShortDeadlines() {
    options_.health = {.ask_after = milliseconds(50),
                       .lost_after = milliseconds(200),
                       .keep_alive_after = milliseconds(100),
                       .first_answer_after = milliseconds(200)};
  }

  // Sends `message` to agent 2 until the transport refuses it. Returns the number of accepted messages.
  int Fill(const proto::Message& message) {
    int accepted = 0;
    while (transports_[1]->Send({2, "sync"}, message) == SendResult::kAccepted) {
      ++accepted;
    }
    return accepted;
  }

  // Returns a frame in which agent 2 reports that it received `received_bytes` over the connection `reported_link`.
  static std::string Report(std::uint32_t link, std::uint32_t reported_link, std::uint64_t received_bytes) {
    proto::Message message = Message(2, 1);
    message.clear_record_id();
    message.mutable_link_report()->set_reported_link(reported_link);
    message.mutable_link_report()->set_received_bytes(received_bytes);
    return OnLink(link, ToPeerFrame(message));
  }

  static proto::Message Marked(const std::string& mark, std::size_t bytes = 1000) {
    proto::Message message = Message(1, 2, bytes);
    message.set_sql(mark);
    return message;
  }

  SendResult SendToPeer(const proto::Message& message) { return transports_[1]->Send({2, "sync"}, message); }

  // Sends messages as agent 2, but no reports of received bytes. Expects that agent 1 gives agent 2 up.
  void ExpectGivenUpAlthoughItTalks(RawDealer& dealer) {
    std::atomic<bool> is_over = false;
    std::thread talk([&] {
      while (!is_over) {
        dealer.Send(OnLink(7, ToPeerFrame(Message(2, 1))));
        EXPECT_NE(ears_[1].Take(), nullptr);
      }
    });
    (void)Fill(Marked("bulk"));
    EXPECT_TRUE(ears_[1].WaitUntilLost(2));
    is_over = true;
    talk.join();
    EXPECT_GE(Peer(1, 2).lost_by_deadline(), 1);
  }

  ZeroMqTransport::Options options_;
};

TEST_F(TransportFaultsTest, NothingIsQueuedForAnAbsentPeer) {
  Start(1, options_);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(SendToPeer(Marked("old")), SendResult::kUnreachable);
  EXPECT_EQ(Peer(1, 2).dropped_messages(), 100);
  EXPECT_EQ(Peer(1, 2).queued_messages(), 0);
  Start(2, options_);
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  ASSERT_EQ(SendToPeer(Marked("new")), SendResult::kAccepted);
  EXPECT_EQ(ears_[2].Take()->sql(), "new");
}

TEST_F(TransportFaultsTest, AFrozenPeerIsSentNoMoreThanTheCredit) {
  Start(1, options_);
  RawRouter frozen(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  const int accepted = Fill(Marked("bulk"));
  const proto::PeerStatus status = Peer(1, 2);
  EXPECT_GT(status.unreported_bytes(), 0);
  EXPECT_LE(status.unreported_bytes(), kCreditBytes);
  EXPECT_EQ(status.sent_bytes(), status.unreported_bytes());
  EXPECT_LE(status.queued_bytes(), options_.outbox.bytes_max);
  EXPECT_EQ(status.sent_messages() + status.queued_messages(), accepted);
}

TEST_F(TransportFaultsTest, AFrozenPeerIsGivenUpUnderAFlood) {
  UseShortDeadlines();
  Start(1, options_);
  RawRouter frozen(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  std::atomic<bool> is_over = false;
  std::thread flood([&] {
    while (!is_over) (void)SendToPeer(Marked("bulk"));
  });
  EXPECT_TRUE(ears_[1].WaitUntilLost(2));
  is_over = true;
  flood.join();
  const proto::PeerStatus status = Peer(1, 2);
  EXPECT_GE(status.lost_by_deadline(), 1);
  EXPECT_LE(status.sent_bytes(), kCreditBytes * status.connects());
}

// Agent 1 must give the frozen peer up after lost_after, by default 3 s. The test allows 4.5 s, for a busy machine. The
// frozen peer never answers, so the test also shortens first_answer_after to lost_after.
TEST_F(TransportFaultsTest, AFrozenPeerIsGivenUpInTimeWhileAnotherFloods) {
  options_.health.first_answer_after = options_.health.lost_after;
  Start(1, options_);
  Start(3, options_);
  RawRouter frozen(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  ASSERT_TRUE(ears_[3].WaitForPeer(1, true));
  std::atomic<bool> is_lost = false;
  std::atomic<bool> is_over = false;
  std::thread flood_from([&] {
    while (!is_over) (void)transports_[3]->Send({1, "sync"}, Message(3, 1, 1000));
  });
  std::thread flood_to([&] {
    while (!is_over) (void)SendToPeer(Marked("bulk"));
  });
  std::thread reader([&] {
    while (!is_lost) (void)ears_[1].Take();
  });
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_TRUE(ears_[1].WaitUntilLost(2));
  const auto took = std::chrono::steady_clock::now() - begun;
  is_lost = true;
  reader.join();
  is_over = true;
  flood_from.join();
  flood_to.join();
  EXPECT_EQ(LinkHealth::Options().lost_after, std::chrono::seconds(3));
  EXPECT_LT(took, std::chrono::milliseconds(4500));
  EXPECT_GE(Peer(1, 2).lost_by_deadline(), 1);
  EXPECT_EQ(Peer(1, 3).lost_by_deadline(), 0) << "who floods is there";
}

TEST_F(TransportFaultsTest, AFrozenPeerIsGivenUpWhenNothingIsSentEither) {
  UseShortDeadlines();
  Start(1, options_);
  RawRouter frozen(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  EXPECT_TRUE(ears_[1].WaitUntilLost(2));
}

TEST_F(TransportFaultsTest, APeerThatAnswersIsKept) {
  UseShortDeadlines();
  Start(1, options_);
  RawRouter router(AddressOf(2));
  RawDealer dealer(AddressOf(1), nullptr, "2");
  for (std::uint32_t i = 0; i < 5; ++i) {
    (void)router.ReceiveReport([](const proto::LinkReport& r) { return r.is_asking(); });
    dealer.Send(Report(/*link=*/7, router.last_link(), 0));
  }
  EXPECT_EQ(Peer(1, 2).lost_by_deadline(), 0);
  EXPECT_EQ(Peer(1, 2).connects(), 1);
}

TEST_F(TransportFaultsTest, MessagesSentToALostConnectionDoNotReachTheNext) {
  UseShortDeadlines();
  Start(1, options_);
  RawRouter router(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  (void)Fill(Marked("old"));
  ASSERT_TRUE(ears_[1].WaitUntilConnected(2, 2));
  ASSERT_EQ(SendToPeer(Marked("new")), SendResult::kAccepted);
  std::set<std::uint32_t> links_with_old;
  RawRouter::Frame frame = router.Receive();
  for (; frame.message.sql() != "new"; frame = router.Receive()) {
    ASSERT_FALSE(frame.route.empty());
    if (frame.message.sql() == "old") links_with_old.insert(router.last_link());
  }
  EXPECT_EQ(links_with_old.count(router.last_link()), 0u);
}

TEST_F(TransportFaultsTest, MessagesWaitingWhenAConnectionBreaksDoNotReachTheNext) {
  Start(1, options_);
  auto router = std::make_unique<RawRouter>(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  const int accepted = Fill(Marked("old"));
  const double sent = Peer(1, 2).sent_messages();
  router.reset();
  ASSERT_TRUE(ears_[1].WaitForPeer(2, false));
  EXPECT_EQ(Peer(1, 2).dropped_messages(), 1 + accepted - sent) << "the one that was refused, and those that waited";
  RawRouter next(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  ASSERT_EQ(SendToPeer(Marked("new")), SendResult::kAccepted);
  EXPECT_TRUE(next.Receive().message.has_link_report()) << "a connection begins with a report";
  EXPECT_EQ(next.ReceiveMessage().sql(), "new");
}

TEST_F(TransportFaultsTest, APeerThatFloodsLeavesOthersTheirShare) {
  options_.client_endpoint = ClientEndpointHere();
  Start(1, options_);
  options_.client_endpoint.clear();
  Start(2, options_);
  Start(3, options_);
  ASSERT_TRUE(ears_[2].WaitForPeer(1, true));
  ASSERT_TRUE(ears_[3].WaitForPeer(1, true));
  std::atomic<bool> is_over = false;
  std::thread flood([&] {
    const proto::Message bulk = Message(2, 1, 1000);
    while (!is_over) {
      if (transports_[2]->Send({1, "sync"}, bulk) != SendResult::kAccepted) std::this_thread::yield();
    }
  });
  const auto take_from = [&](AgentId sender) {
    OwnedMessage message = ears_[1].Take();
    while (message != nullptr && message->hop_sender() != sender) message = ears_[1].Take();
    return message;
  };
  EXPECT_NE(take_from(2), nullptr);
  RawDealer client(ClientEndpointHere());
  for (int i = 0; i < 20; ++i) {
    ASSERT_EQ(transports_[3]->Send({1, "sync"}, Message(3, 1)), SendResult::kAccepted);
    EXPECT_NE(take_from(3), nullptr);
    client.Send(Message(0, 0).SerializeAsString());
    EXPECT_NE(take_from(kClients), nullptr);
    for (const proto::PeerStatus& status : transports_[2]->Peers()) {
      EXPECT_LE(status.unreported_bytes(), kCreditBytes);
      EXPECT_LE(status.queued_bytes(), options_.outbox.bytes_max);
    }
  }
  is_over = true;
  flood.join();
}

TEST_F(TransportFaultsTest, ARestartedPeerReplacesItsOldConnectionUnderTheSameIdentity) {
  Start(1, options_);
  RawRouter router(AddressOf(2));
  RawDealer earlier(AddressOf(1), nullptr, "2");
  earlier.Send(Report(/*link=*/7, 0, 0));
  earlier.Send(OnLink(7, ToPeerFrame(Message(2, 1, 100))));
  ASSERT_NE(ears_[1].Take(), nullptr);
  // The peer's earlier connection is still open.
  RawDealer later(AddressOf(1), nullptr, "2");
  later.Send(Report(/*link=*/8, 0, 0));
  const std::string messages = ToPeerFrame(Message(2, 1, 200));
  later.Send(OnLink(8, messages));
  ASSERT_NE(ears_[1].Take(), nullptr);
  // Messages over a connection without a routing id are delivered, but reports over it do not count.
  RawDealer nameless(AddressOf(1));
  nameless.Send(Report(/*link=*/9, 0, 0));
  nameless.Send(OnLink(9, ToPeerFrame(Message(2, 1, 300))));
  ASSERT_NE(ears_[1].Take(), nullptr);
  proto::PeerFrame asking;
  ASSERT_TRUE(asking.ParseFromString(Report(/*link=*/8, 0, 0)));
  asking.mutable_messages(0)->mutable_link_report()->set_is_asking(true);
  later.Send(asking.SerializeAsString());
  const proto::LinkReport report = router.ReceiveReport(
      [&](const proto::LinkReport& r) { return r.reported_link() == 8 && r.received_bytes() > 0; });
  EXPECT_EQ(report.received_bytes(), messages.size());
  EXPECT_EQ(Peer(1, 2).refused_reports(), 1);
}

TEST_F(TransportFaultsTest, SendsMoreOnlyAsThePeerReports) {
  Start(1, options_);
  RawRouter router(AddressOf(2));
  RawDealer dealer(AddressOf(1), nullptr, "2");
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  std::uint64_t bytes = 0;
  int count = 0;
  const proto::Message message = Marked("bulk");
  for (int i = 0; i < 50; ++i) ASSERT_EQ(SendToPeer(message), SendResult::kAccepted);
  while (count < 50) {
    const proto::PeerStatus status = Peer(1, 2);
    EXPECT_LE(status.sent_bytes() - static_cast<double>(bytes), kCreditBytes);
    for (; count < status.sent_messages(); ++count) bytes += ToPeerFrame(router.ReceiveMessage()).size();
    dealer.Send(Report(/*link=*/7, router.last_link(), bytes));
    if (count < 50) {
      // The report gave credit for one more message.
      bytes += ToPeerFrame(router.ReceiveMessage()).size();
      ++count;
    }
  }
  EXPECT_EQ(Peer(1, 2).refused_reports(), 0);
}

TEST_F(TransportFaultsTest, ControlOvertakesWaitingBulkDataAndTheNewestRolesReplaceOlderOnes) {
  Start(1, options_);
  RawRouter router(AddressOf(2));
  RawDealer dealer(AddressOf(1), nullptr, "2");
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  proto::Message map = Marked("map");
  map.set_ms_type(proto::DATA);
  map.set_data_type(proto::LOCAL_TRAVERSABILITY_MAP);
  const int accepted = Fill(map);
  for (const char* reason : {"first", "second", "third"}) {
    proto::Message roles = Marked("roles", 1100);  // This message is larger than the remaining credit.
    roles.set_ms_type(proto::CONTROL);
    roles.mutable_role_announce()->mutable_roles()->set_reason(reason);
    EXPECT_EQ(SendToPeer(roles), SendResult::kAccepted) << "although the outbox is full of maps";
  }
  const int sent = static_cast<int>(Peer(1, 2).sent_messages());
  ASSERT_LT(sent, accepted);
  std::uint64_t bytes = 0;
  for (int i = 0; i < sent; ++i) bytes += ToPeerFrame(router.ReceiveMessage()).size();
  dealer.Send(Report(/*link=*/7, router.last_link(), bytes));
  EXPECT_EQ(router.ReceiveMessage().role_announce().roles().reason(), "third");
  EXPECT_EQ(router.ReceiveMessage().sql(), "map");
  EXPECT_EQ(Peer(1, 2).replaced_messages(), 2);
}

TEST_F(TransportFaultsTest, SmallMessagesInABurstShareFramesAndKeepTheirOrder) {
  Start(1, options_);
  RawRouter router(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  constexpr int kMessages = 60;
  for (int i = 0; i < kMessages; ++i) ASSERT_EQ(SendToPeer(Marked(std::to_string(i), 10)), SendResult::kAccepted);
  for (int i = 0; i < kMessages; ++i) EXPECT_EQ(router.ReceiveMessage().sql(), std::to_string(i));
  EXPECT_EQ(Peer(1, 2).sent_messages(), kMessages);
  EXPECT_LT(router.frames(), kMessages);
}

TEST_F(TransportFaultsTest, ALargerMessageIsSentByItselfAndAnnounced) {
  Start(1, options_);
  RawRouter router(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  const proto::Message large = Marked("large", 3 * kCreditBytes);
  ASSERT_EQ(SendToPeer(large), SendResult::kAccepted);
  ASSERT_EQ(SendToPeer(Marked("next")), SendResult::kAccepted);
  EXPECT_EQ(router.ReceiveMessage().sql(), "large");
  EXPECT_EQ(router.last_report().coming_bytes(), ToPeerFrame(large).size());
  EXPECT_EQ(Peer(1, 2).queued_messages(), 1);
}

TEST_F(TransportFaultsTest, RefusesInvalidReports) {
  Start(1, options_);
  RawRouter router(AddressOf(2));
  RawDealer dealer(AddressOf(1), nullptr, "2");
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  ASSERT_EQ(SendToPeer(Marked("one")), SendResult::kAccepted);
  const std::uint64_t bytes = ToPeerFrame(router.ReceiveMessage()).size();
  const std::uint32_t link = router.last_link();
  dealer.Send(Report(/*link=*/7, link, bytes + 1));  // Reports more bytes than were sent.
  dealer.Send(Report(/*link=*/7, link - 1, bytes));  // Reports on an earlier connection.
  dealer.Send(Report(/*link=*/7, link, bytes));
  dealer.Send(Report(/*link=*/7, link, bytes - 1));  // Reports fewer bytes than before.
  dealer.Send(OnLink(7, ToPeerFrame(Message(2, 1))));
  ASSERT_FALSE(ears_[1].Take()->has_link_report()) << "actors do not hear of reports";
  EXPECT_EQ(Peer(1, 2).refused_reports(), 3);
  EXPECT_EQ(Peer(1, 2).unreported_bytes(), 0);
}

TEST_F(TransportFaultsTest, APeerThatStopsReportingIsGivenUpAlthoughItSends) {
  UseShortDeadlines();
  Start(1, options_);
  RawRouter router(AddressOf(2));
  RawDealer dealer(AddressOf(1), nullptr, "2");
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  (void)router.ReceiveReport([](const proto::LinkReport&) { return true; });
  dealer.Send(Report(/*link=*/7, router.last_link(), 0));
  ExpectGivenUpAlthoughItTalks(dealer);
}

TEST_F(TransportFaultsTest, APeerThatNeverReportsIsGivenUpAlthoughItSends) {
  UseShortDeadlines();
  Start(1, options_);
  RawRouter router(AddressOf(2));
  RawDealer dealer(AddressOf(1), nullptr, "2");
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  ExpectGivenUpAlthoughItTalks(dealer);
}

}  // namespace
}  // namespace moondb
