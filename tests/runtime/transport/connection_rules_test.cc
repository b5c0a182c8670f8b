#include "runtime/transport/connection_rules.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using Cause = ConnectionRules::Cause;

constexpr std::uint16_t kPort = 7400;
constexpr std::uint16_t kClientPort = 7500;
constexpr std::uint64_t kSharedBytes = 32 * 1024 * 1024;

// The port of agents admits 8 connections from 10.0.0.2 (two agents), 4 from 10.0.0.3 (one agent) and 5 from other
// addresses, but at most 4 with the same key. The port of clients admits 3 connections, but at most 2 with the same
// key.
class ConnectionRulesTest : public testing::Test {
 protected:
  void Open(int file, const std::string& peer, std::uint16_t port = kPort) {
    open_[file] = {file, port, peer, ++last_peer_port_, 0};
  }
  void Receive(int file, std::uint64_t bytes) { open_.at(file).bytes_received += bytes; }
  void Deliver(int file, const std::string& key = {}) { rules_.OnMessage(file, key); }

  // Returns the file descriptors of the connections that the rules cut. Each cut must have the cause `cause`. Closes
  // these connections if `frees_` is true.
  std::vector<int> Judge(Cause cause) {
    std::vector<TcpConnection> now;
    for (const auto& [file, connection] : open_) now.push_back(connection);
    std::vector<int> files;
    for (const ConnectionRules::Cut& cut : rules_.Judge(now)) {
      EXPECT_EQ(cut.cause, cause);
      files.push_back(cut.connection.file);
      if (frees_) open_.erase(cut.connection.file);
    }
    return files;
  }
  std::vector<int> TooMany() { return Judge(Cause::kTooMany); }
  std::vector<int> TooManyOfKey() { return Judge(Cause::kTooManyOfKey); }
  std::vector<int> TooMuch() { return Judge(Cause::kTooMuch); }

  ConnectionRules rules_{
      {{kPort, {{{"10.0.0.2", 8}, {"10.0.0.3", 4}}, 5, 4, kSharedBytes}}, {kClientPort, {{}, 3, 2, kSharedBytes}}}};
  std::map<int, TcpConnection> open_;
  std::uint16_t last_peer_port_ = 0;
  bool frees_ = true;
};

TEST_F(ConnectionRulesTest, AdmitsAsManyConnectionsAsThereArePlaces) {
  for (int i = 0; i < 8; ++i) Open(10 + i, "10.0.0.2");
  for (int i = 0; i < 4; ++i) Open(20 + i, "10.0.0.3");
  for (int i = 0; i < 5; ++i) Open(30 + i, "192.168.1." + std::to_string(i));
  for (int i = 0; i < 3; ++i) Open(40 + i, "10.0.0.2", kClientPort);
  EXPECT_THAT(TooMany(), IsEmpty());
}

TEST_F(ConnectionRulesTest, UnknownAddressesDoNotUseThePlacesOfAgents) {
  for (int i = 0; i < 3; ++i) Open(100 + i, "192.168.1.66");
  EXPECT_THAT(TooMany(), IsEmpty());
  for (int i = 3; i < 50; ++i) Open(100 + i, "192.168.1.66");
  Open(10, "10.0.0.2");
  EXPECT_EQ(TooMany().size(), 45u);
  EXPECT_TRUE(open_.contains(10));
  EXPECT_TRUE(open_.contains(149)) << "the newest ones stay: one of them may be true";
  EXPECT_FALSE(open_.contains(100));
}

TEST_F(ConnectionRulesTest, ConnectionsThatDeliveredAMessageStayLongest) {
  for (int i = 0; i < 5; ++i) Open(10 + i, "192.168." + std::to_string(i) + ".1");
  Deliver(10);
  EXPECT_THAT(TooMany(), IsEmpty());
  Open(20, "192.168.66.1");
  EXPECT_THAT(TooMany(), ElementsAre(11)) << "the oldest of the silent ones";
  for (const int file : {12, 13, 14, 20}) Deliver(file);
  Open(21, "192.168.66.1");
  Deliver(21);
  EXPECT_THAT(TooMany(), ElementsAre(20)) << "the oldest of the address that has most";
  EXPECT_TRUE(open_.contains(10));
}

TEST_F(ConnectionRulesTest, ANetworkWithManyAddressesDoesNotEvictSilentConnectionsOfOthers) {
  Open(10, "10.9.8.7");
  Open(11, "2001:db8:1:2::1");
  for (int i = 0; i < 40; ++i) Open(100 + i, "192.168.1." + std::to_string(i));
  for (int i = 0; i < 40; ++i) Open(200 + i, "2001:db8:1:3::" + std::to_string(i));
  EXPECT_EQ(TooMany().size(), 77u);
  EXPECT_TRUE(open_.contains(10) && open_.contains(11));
}

TEST_F(ConnectionRulesTest, AnAddressWithManyConnectionsDoesNotEvictSilentOnesOfOthersInItsNetwork) {
  Open(10, "192.168.1.7");
  for (int i = 0; i < 40; ++i) Open(100 + i, "192.168.1.66");
  EXPECT_EQ(TooMany().size(), 36u);
  EXPECT_TRUE(open_.contains(10));
}

TEST_F(ConnectionRulesTest, AnAddressThatDeliveredAMessageWithinTheHourIsAdmittedAgain) {
  const auto judge = [this](std::chrono::minutes at) {
    std::vector<TcpConnection> now;
    for (const auto& [file, connection] : open_) now.push_back(connection);
    for (const auto& cut : rules_.Judge(now, ConnectionRules::Time(at))) open_.erase(cut.connection.file);
  };
  for (const bool is_late : {false, true}) {
    SCOPED_TRACE(is_late);
    const std::chrono::minutes begin(is_late ? 1000 : 0);
    Open(10, "10.9.8.7");
    Deliver(10);
    judge(begin);
    open_.erase(10);
    Open(11, "10.9.8.7");
    for (int i = 0; i < 90; ++i) Open(100 + i, "172.16." + std::to_string(i) + ".1");
    judge(begin + std::chrono::minutes(is_late ? 61 : 59));
    EXPECT_EQ(open_.contains(11), !is_late) << "it is the oldest of those that brought nothing yet";
    open_.clear();
  }
}

TEST_F(ConnectionRulesTest, AConnectionThatDeliveredAMessageStaysThoughNewerOnesOfItsAddressAreSilent) {
  for (int i = 0; i < 3; ++i) Open(10 + i, "10.9.8.7", kClientPort);
  Deliver(10);
  EXPECT_THAT(TooMany(), IsEmpty());
  for (int i = 0; i < 20; ++i) Open(20 + i, "10.9.8.7", kClientPort);
  EXPECT_EQ(TooMany().size(), 20u);
  EXPECT_TRUE(open_.contains(10));
}

TEST_F(ConnectionRulesTest, CutsTheLongestSilentConnectionOfAKeyWithTooMany) {
  Open(10, "10.0.0.9", kClientPort);
  Open(11, "10.0.0.9", kClientPort);
  Open(12, "10.0.0.9", kClientPort);
  Deliver(10, "watcher");
  Deliver(11, "sharer");
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
  Deliver(12, "watcher");
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
  Deliver(10, "watcher");
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
  Open(13, "10.0.0.9", kClientPort);
  Deliver(13, "watcher");
  EXPECT_THAT(TooManyOfKey(), ElementsAre(12)) << "the other key keeps its place, and so does who spoke since";
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
}

TEST_F(ConnectionRulesTest, AMessageOfAnEarlierConnectionWithTheSameFileDoesNotCount) {
  for (int i = 0; i < 2; ++i) Open(10 + i, "10.0.0.9", kClientPort);
  for (int i = 0; i < 2; ++i) Deliver(10 + i, "sharer");
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
  // File descriptor 12 belonged to an earlier connection. That connection was opened, delivered a message and was
  // closed between two calls of Judge.
  rules_.OnMessage(12, "sharer", /*peer_port=*/999);
  Open(12, "10.0.0.9", kClientPort);
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
  rules_.OnMessage(12, "sharer", open_.at(12).peer_port);
  EXPECT_THAT(TooManyOfKey(), ElementsAre(10));
}

TEST_F(ConnectionRulesTest, AKeyIsAdmittedAsOftenAsItHasPlacesEvenIfItsConnectionsAreSilent) {
  for (int i = 0; i < 2; ++i) Open(10 + i, "10.0.0.9", kClientPort);
  EXPECT_TRUE(rules_.Admit(kClientPort, "watcher", "10.0.0.9"));
  EXPECT_TRUE(rules_.Admit(kClientPort, "watcher", "10.0.0.9"));
  EXPECT_FALSE(rules_.Admit(kClientPort, "watcher", "10.0.0.9"));
  EXPECT_TRUE(rules_.Admit(kClientPort, "sharer", "10.0.0.9")) << "another key has its own places";
  Open(12, "10.0.0.9", kClientPort);
  Deliver(10, "watcher");
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
  EXPECT_FALSE(rules_.Admit(kClientPort, "watcher", "10.0.0.9")) << "one that spoke and one that is silent";
  open_.erase(10);
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
  EXPECT_TRUE(rules_.Admit(kClientPort, "watcher", "10.0.0.9")) << "the one that spoke has left";
}

TEST_F(ConnectionRulesTest, AdmissionsEndWithTheSilentConnectionsOfTheirAddress) {
  for (int i = 0; i < 2; ++i) Open(10 + i, "10.0.0.9", kClientPort);
  for (int i = 0; i < 2; ++i) EXPECT_TRUE(rules_.Admit(kClientPort, "watcher", "10.0.0.9"));
  EXPECT_THAT(TooMany(), IsEmpty());
  EXPECT_FALSE(rules_.Admit(kClientPort, "watcher", "10.0.0.9"));
  open_.erase(11);
  Open(12, "10.0.0.8", kClientPort);
  EXPECT_THAT(TooMany(), IsEmpty());
  EXPECT_TRUE(rules_.Admit(kClientPort, "watcher", "10.0.0.8")) << "one left, whichever it was";
  EXPECT_FALSE(rules_.Admit(kClientPort, "watcher", "10.0.0.8"));
}

TEST_F(ConnectionRulesTest, AConnectionThatChoseItsRoutingIdIsCut) {
  Open(10, "10.0.0.9", kClientPort);
  Open(11, "10.0.0.9", kClientPort);
  rules_.OnMessage(10, "watcher", open_.at(10).peer_port, /*has_claimed_id=*/true);
  rules_.OnMessage(11, "watcher", open_.at(11).peer_port, /*has_claimed_id=*/false);
  EXPECT_THAT(Judge(Cause::kClaimedId), ElementsAre(10));
}

TEST_F(ConnectionRulesTest, AMemberDoesNotUseAnotherMembersPlaces) {
  for (int i = 0; i < 2; ++i) Open(10 + i, "10.0.0.2");
  Deliver(10, "1");
  Deliver(11, "2");
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
  for (int i = 0; i < 6; ++i) {
    Open(20 + i, "10.0.0.2");
    Deliver(20 + i, "2");
  }
  EXPECT_THAT(TooManyOfKey(), ElementsAre(11, 20, 21));
}

TEST_F(ConnectionRulesTest, ConnectionsWithoutKeysBelongToNoKey) {
  for (int i = 0; i < 8; ++i) {
    Open(10 + i, "10.0.0.2");
    Deliver(10 + i);
  }
  EXPECT_THAT(TooManyOfKey(), IsEmpty());
}

TEST_F(ConnectionRulesTest, AReusedFileIsAnotherConnection) {
  for (int i = 0; i < 5; ++i) Open(10 + i, "192.168.1." + std::to_string(i));
  Deliver(10);
  Receive(10, 1000);
  EXPECT_THAT(TooMany(), IsEmpty());
  Open(10, "192.168.1.66");  // The earlier connection with file descriptor 10 was closed.
  for (const int file : {11, 12, 13, 14}) Deliver(file);
  Open(20, "192.168.1.66");
  EXPECT_THAT(TooMany(), ElementsAre(10));
}

TEST_F(ConnectionRulesTest, OneLargeMessageIsAdmitted) {
  Open(10, "10.0.0.2");
  Receive(10, 5000);
  Deliver(10);
  for (int i = 0; i < 32; ++i) {
    Receive(10, 1024 * 1024);
    EXPECT_THAT(TooMuch(), IsEmpty());
  }
  Deliver(10);
  EXPECT_THAT(TooMuch(), IsEmpty());
  for (int i = 0; i < 32; ++i) Receive(10, 1024 * 1024);
  EXPECT_THAT(TooMuch(), IsEmpty()) << "what came with whole messages does not count";
}

TEST_F(ConnectionRulesTest, ConnectionsWithEndlessMessagesAreCutLargestFirst) {
  Open(10, "10.0.0.2");
  Open(11, "10.0.0.3");
  Receive(10, 30'000'000);
  Receive(11, 3'000'000);
  EXPECT_THAT(TooMuch(), IsEmpty());
  Receive(11, 1'000'000);
  EXPECT_THAT(TooMuch(), ElementsAre(10));
  Open(12, "10.0.0.3");
  Receive(12, kSharedBytes + ConnectionRules::kFreeBytes);
  EXPECT_THAT(TooMuch(), ElementsAre(12));
}

TEST_F(ConnectionRulesTest, SmallMessagesInManyConnectionsDoNotCount) {
  for (int i = 0; i < 8; ++i) {
    Open(10 + i, "10.0.0.2");
    Receive(10 + i, ConnectionRules::kFreeBytes);
  }
  Open(30, "10.0.0.3");
  Receive(30, kSharedBytes);
  EXPECT_THAT(TooMuch(), IsEmpty());
}

TEST_F(ConnectionRulesTest, ListenersAreCountedSeparately) {
  Open(10, "10.0.0.2");
  Receive(10, kSharedBytes);
  Open(40, "10.0.0.2", kClientPort);
  Receive(40, kSharedBytes);
  EXPECT_THAT(TooMuch(), IsEmpty());
}

// While libzmq is still closing a connection that was cut, the rules do not report the connection again, and its bytes
// do not count.
TEST_F(ConnectionRulesTest, ReportsACutConnectionOnce) {
  frees_ = false;
  Open(10, "10.0.0.2");
  Receive(10, kSharedBytes + ConnectionRules::kFreeBytes + 1);
  EXPECT_THAT(TooMuch(), ElementsAre(10));
  EXPECT_THAT(TooMuch(), IsEmpty());
  Open(11, "10.0.0.3");
  Receive(11, kSharedBytes);
  EXPECT_THAT(TooMuch(), IsEmpty()) << "its bytes do not count any more";
}

}  // namespace
}  // namespace moondb
