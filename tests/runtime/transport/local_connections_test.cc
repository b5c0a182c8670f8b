#include "runtime/transport/local_connections.h"

#include <gmock/gmock.h>
#include <unistd.h>

#include <optional>
#include <thread>

#include "runtime/transport/zmq_socket.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::size_t kMax = 3;

// Connections of local clients, without sockets. At most kMax may stay open.
class LocalConnectionsTest : public testing::Test {
 protected:
  void Open(int file, int process) {
    open_[file] = {++last_socket_, process};
    now_ += std::chrono::milliseconds(1);
    connections_.OnAccepted(file, now_);
  }
  void Request(int file) {
    now_ += std::chrono::milliseconds(1);
    connections_.OnRequest(file, "route" + std::to_string(file), now_);
  }
  void Reply(int file) { connections_.OnReply("route" + std::to_string(file)); }
  // Returns the descriptors of the connections that are cut, and closes them.
  std::vector<int> CutExcess() {
    cut_.clear();
    const std::size_t count = connections_.CutExcess(now_);
    EXPECT_EQ(count, cut_.size());
    for (const int file : cut_) open_.erase(file);
    return cut_;
  }

  std::map<int, LocalConnections::Peer> open_;
  std::vector<int> cut_;
  std::uint64_t last_socket_ = 100;
  LocalConnections::Time now_{};
  LocalConnections connections_{kMax,
                                {.peer_of = [this](int file) -> std::optional<LocalConnections::Peer> {
                                   const auto found = open_.find(file);
                                   return found == open_.end() ? std::nullopt : std::optional(found->second);
                                 },
                                 .socket_of = [this](int file) -> std::uint64_t {
                                   const auto found = open_.find(file);
                                   return found == open_.end() ? 0 : found->second.socket;
                                 },
                                 .shut_down = [this](int file) { cut_.push_back(file); }}};
};

TEST_F(LocalConnectionsTest, CutsTheConnectionThatWasSilentForLongest) {
  for (int file = 1; file <= 3; ++file) Open(file, 7);
  Request(1);
  Reply(1);
  EXPECT_THAT(CutExcess(), IsEmpty());
  Open(4, 7);
  EXPECT_THAT(CutExcess(), ElementsAre(2));
  EXPECT_THAT(CutExcess(), IsEmpty());
}

TEST_F(LocalConnectionsTest, TheProcessWithTheMostConnectionsLosesOne) {
  Open(1, 7);
  Open(2, 8);
  Open(3, 8);
  Open(4, 9);
  EXPECT_THAT(CutExcess(), ElementsAre(2));
}

TEST_F(LocalConnectionsTest, AConnectionWithAnUnansweredRequestIsCutLast) {
  Open(1, 7);
  Open(2, 7);
  Open(3, 8);
  Request(1);
  Request(2);
  Open(4, 7);
  EXPECT_THAT(CutExcess(), ElementsAre(4));
  Open(5, 7);
  Reply(2);
  EXPECT_THAT(CutExcess(), ElementsAre(2));
  Request(3);
  Request(5);
  Open(6, 9);
  Request(6);
  EXPECT_THAT(CutExcess(), ElementsAre(1)) << "all are busy";
}

TEST_F(LocalConnectionsTest, ARequestThatIsNeverAnsweredCountsForALimitedTime) {
  Open(1, 7);
  Request(1);
  now_ += LocalConnections::kUnansweredMax;
  for (int file = 2; file <= 4; ++file) Open(file, 7);
  EXPECT_THAT(CutExcess(), ElementsAre(1));
}

TEST_F(LocalConnectionsTest, ClosedConnectionsAndReusedDescriptorsDoNotCount) {
  for (int file = 1; file <= 3; ++file) Open(file, 7);
  Request(1);
  open_.erase(2);
  Open(4, 7);
  EXPECT_THAT(CutExcess(), IsEmpty());
  Open(1, 7);  // Another connection with the descriptor of one that closed with an unanswered request.
  Open(5, 7);
  EXPECT_THAT(CutExcess(), ElementsAre(3));
  Open(6, 7);
  EXPECT_THAT(CutExcess(), ElementsAre(4));
  Open(7, 7);
  EXPECT_THAT(CutExcess(), ElementsAre(1));
}

TEST_F(LocalConnectionsTest, ARoutingIdMayMoveToAnotherConnection) {
  Open(1, 7);
  connections_.OnRequest(1, "chosen", now_);
  open_.erase(1);
  Open(2, 7);
  connections_.OnRequest(2, "chosen", now_);
  Open(1, 7);  // Replaces the entry of the closed connection.
  connections_.OnReply("chosen");
  Open(3, 7);
  Open(4, 7);
  EXPECT_THAT(CutExcess(), ElementsAre(2)) << "no request over it is unanswered";
}

TEST_F(LocalConnectionsTest, CutsSeveralAtATime) {
  LocalConnections connections(16, {.peer_of =
                                        [](int file) {
                                          return LocalConnections::Peer{std::uint64_t(file), 7};
                                        },
                                    .socket_of = [](int file) { return std::uint64_t(file); },
                                    .shut_down = [](int) {}});
  for (int file = 1; file <= 18; ++file) connections.OnAccepted(file, now_);
  EXPECT_EQ(connections.CutExcess(now_), 0u);
  connections.OnAccepted(19, now_);
  EXPECT_EQ(connections.CutExcess(now_), 3u);
}

TEST_F(LocalConnectionsTest, IgnoresConnectionsOfOtherSockets) {
  for (int file = 1; file <= 3; ++file) Open(file, 7);
  for (int file = 10; file < 20; ++file) {
    connections_.OnAccepted(file, now_);
    connections_.OnRequest(file, "route", now_);
  }
  EXPECT_THAT(CutExcess(), IsEmpty());
}

TEST(LocalConnectionsSystemTest, FindsTheProcessOfAMessageAndShutsItsConnectionDown) {
  const TemporaryFolder folder;
  const std::string path = (folder.path() / "clients.sock").string();
  const ZmqContext context = MakeZmqContext(/*io_threads=*/1);
  std::optional<ZmqSocket> monitor;  // Declared before the router, because it must be closed after it.
  ZmqSocket router = *ZmqSocket::Make(context, ZMQ_ROUTER);
  monitor = *router.MakeMonitor(context, "inproc://local-connections", ZMQ_EVENT_DISCONNECTED);
  ASSERT_TRUE(router.Bind("ipc://" + path));
  ZmqSocket dealer = *ZmqSocket::Make(context, ZMQ_DEALER);
  ASSERT_TRUE(dealer.Connect("ipc://" + path));
  ZmqFrame frame("request");
  ASSERT_EQ(dealer.Send(&frame), ZmqSend::kSent);
  ZmqReceived received;
  while (!router.Receive(&received)) std::this_thread::yield();
  const LocalConnections::System system = LocalConnections::SystemFor(path);
  const std::optional<LocalConnections::Peer> peer = system.peer_of(received.file);
  ASSERT_TRUE(peer);
  EXPECT_EQ(peer->process, ::getpid());
  EXPECT_EQ(peer->socket, system.socket_of(received.file));
  EXPECT_FALSE(LocalConnections::SystemFor(path + "2").peer_of(received.file));
  EXPECT_FALSE(system.peer_of(-1));
  EXPECT_EQ(system.socket_of(-1), 0u);
  system.shut_down(received.file);
  while (!monitor->ReceiveEvent()) {
    router.Process();
    std::this_thread::yield();
  }
  // libzmq in the client connects again by itself.
  while (!router.Receive(&received)) {
    ZmqFrame next("next");
    (void)dealer.Send(&next);
    std::this_thread::yield();
  }
  EXPECT_EQ(received.frame.text(), "next");
}

TEST(LocalConnectionsLimitTest, IsAQuarterOfTheFilesOfTheProcess) {
  EXPECT_EQ(LocalConnections::LimitFor(1024), 256u);
  EXPECT_EQ(LocalConnections::LimitFor(65'536), 1024u);
  EXPECT_EQ(LocalConnections::LimitFor(256), 64u);
  EXPECT_EQ(LocalConnections::LimitFor(0), 1u);
}

}  // namespace
}  // namespace moondb
