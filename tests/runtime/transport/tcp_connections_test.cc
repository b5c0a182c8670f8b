// Tests TcpConnections with real sockets in this process, on ports that the system chooses.
#include "runtime/transport/tcp_connections.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "runtime/transport/listen_address.h"

namespace moondb {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

class Socket {
 public:
  explicit Socket(int file) : file_(file) {}
  Socket(Socket&& other) noexcept : file_(std::exchange(other.file_, -1)) {}
  Socket& operator=(Socket&&) = delete;
  ~Socket() {
    if (file_ >= 0) ::close(file_);
  }
  int file() const { return file_; }

 private:
  int file_;
};

sockaddr_in Loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  return address;
}

class TcpConnectionsTest : public testing::Test {
 protected:
  TcpConnectionsTest() : listener_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address = Loopback(0);
    EXPECT_EQ(::bind(listener_.file(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(listener_.file(), 8), 0);
    socklen_t size = sizeof address;
    EXPECT_EQ(::getsockname(listener_.file(), reinterpret_cast<sockaddr*>(&address), &size), 0);
    port_ = ntohs(address.sin_port);
  }

  std::unique_ptr<TcpConnections> Make() const {
    auto connections = TcpConnections::Make({port_});
    EXPECT_TRUE(connections) << ToString(connections.error());
    return std::move(*connections);
  }
  Socket Connect() const {
    Socket socket(::socket(AF_INET, SOCK_STREAM, 0));
    const sockaddr_in address = Loopback(port_);
    EXPECT_EQ(::connect(socket.file(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    return socket;
  }
  Socket Accept() const { return Socket(::accept(listener_.file(), nullptr, nullptr)); }

  // Returns true if connections.file() becomes readable within `timeout_ms`.
  static bool IsReadable(const TcpConnections& connections, int timeout_ms) {
    pollfd file{connections.file(), POLLIN, 0};
    return ::poll(&file, 1, timeout_ms) == 1;
  }

  Socket listener_;
  std::uint16_t port_ = 0;
};

constexpr int kPatience_ms = 60'000;

TEST_F(TcpConnectionsTest, ListsAcceptedConnectionsAndTheirReceivedBytes) {
  const std::unique_ptr<TcpConnections> connections = Make();
  connections->OnAccepted(listener_.file());
  EXPECT_THAT(connections->List(), IsEmpty()) << "the one that listens is none";
  const Socket theirs = Connect();
  const Socket ours = Accept();
  connections->OnAccepted(ours.file());
  connections->OnAccepted(theirs.file());
  ASSERT_THAT(connections->List(), SizeIs(1)) << "the other end's own port is another one";
  const TcpConnection before = connections->List()[0];
  EXPECT_EQ(before.file, ours.file());
  EXPECT_EQ(before.port, port_);
  EXPECT_EQ(before.peer, "127.0.0.1");
  EXPECT_EQ(before.bytes_received, 0u);
  ASSERT_EQ(::send(theirs.file(), "12345", 5, 0), 5);
  ASSERT_TRUE(IsReadable(*connections, kPatience_ms));
  EXPECT_EQ(connections->List()[0].bytes_received, 5u);
  EXPECT_EQ(connections->List()[0].peer_port, before.peer_port);
}

TEST_F(TcpConnectionsTest, ForgetsADescriptorThatWasClosedOrReusedForSomethingElse) {
  const std::unique_ptr<TcpConnections> connections = Make();
  const Socket theirs = Connect();
  auto ours = std::make_optional(Accept());
  const int file = ours->file();
  connections->OnAccepted(file);
  ASSERT_THAT(connections->List(), SizeIs(1));
  ours.reset();
  const Socket reused(::open("/dev/null", O_RDONLY | O_CLOEXEC));
  ASSERT_EQ(reused.file(), file) << "the kernel gives the lowest free descriptor";
  EXPECT_THAT(connections->List(), IsEmpty());
  EXPECT_EQ(connections->Read(file), std::nullopt);
}

TEST_F(TcpConnectionsTest, ReadsTheConnectionThatReusesADescriptor) {
  const std::unique_ptr<TcpConnections> connections = Make();
  const Socket first = Connect();
  auto ours = std::make_optional(Accept());
  const int file = ours->file();
  ASSERT_EQ(::send(first.file(), "12345", 5, 0), 5);
  ASSERT_EQ(connections->Read(file)->port, port_);
  const Socket second = Connect();
  ours.reset();
  const Socket reused = Accept();
  ASSERT_EQ(reused.file(), file) << "the kernel gives the lowest free descriptor";
  const std::optional<TcpConnection> looked_at = connections->Inspect(file);
  ASSERT_TRUE(looked_at);
  EXPECT_EQ(looked_at->bytes_received, 0u);
  EXPECT_EQ(looked_at->peer_port, connections->Read(file)->peer_port);
}

TEST_F(TcpConnectionsTest, ReadsAConnectionThatThisSideOpened) {
  const std::unique_ptr<TcpConnections> connections = Make();
  const Socket ours = Connect();
  const Socket theirs = Accept();
  EXPECT_EQ(connections->Read(theirs.file())->port, port_);
  const std::optional<TcpConnection> opened = connections->Read(ours.file());
  ASSERT_TRUE(opened);
  EXPECT_EQ(opened->peer_port, port_);
  ASSERT_EQ(::send(theirs.file(), "12345", 5, 0), 5);
  ASSERT_TRUE(IsReadable(*connections, kPatience_ms));
  EXPECT_EQ(connections->Read(ours.file())->bytes_received, 5u);
}

TEST_F(TcpConnectionsTest, SignalsNewDataOnce) {
  const std::unique_ptr<TcpConnections> connections = Make();
  const Socket theirs = Connect();
  const Socket ours = Accept();
  connections->OnAccepted(ours.file());
  (void)connections->List();
  EXPECT_FALSE(IsReadable(*connections, 0));
  ASSERT_EQ(::send(theirs.file(), "1", 1, 0), 1);
  EXPECT_TRUE(IsReadable(*connections, kPatience_ms));
  connections->Drain();
  ASSERT_EQ(::send(theirs.file(), "2", 1, 0), 1);
  EXPECT_FALSE(IsReadable(*connections, 0)) << "until it is looked at";
  (void)connections->List();
  EXPECT_TRUE(IsReadable(*connections, kPatience_ms)) << "what waits is news again";
}

TEST_F(TcpConnectionsTest, ListsConnectionsThoughNoMoreFilesMayBeOpened) {
  const std::unique_ptr<TcpConnections> connections = Make();
  const Socket theirs = Connect();
  const Socket ours = Accept();
  connections->OnAccepted(ours.file());
  rlimit files{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &files), 0);
  const rlimit none{0, files.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const std::size_t count = connections->List().size();
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &files), 0);
  EXPECT_EQ(count, 1u);
}

TEST_F(TcpConnectionsTest, ShutsAConnectionDown) {
  const std::unique_ptr<TcpConnections> connections = Make();
  const Socket theirs = Connect();
  const Socket ours = Accept();
  connections->OnAccepted(ours.file());
  TcpConnections::ShutDown(connections->List()[0]);
  char byte = 0;
  EXPECT_EQ(::recv(theirs.file(), &byte, 1, 0), 0) << "the end";
  TcpConnections::ShutDown({/*file=*/9999, 0, {}, 0, 0});
}

TEST(ListenAddressTest, ParsesPortsAndNumericAddresses) {
  EXPECT_EQ(TcpPortOf("tcp://10.0.0.3:7400"), 7400);
  EXPECT_EQ(TcpPortOf("tcp://[::1]:7400"), 7400);
  EXPECT_EQ(TcpPortOf("ipc:///run/moondb/1.sock"), std::nullopt);
  EXPECT_EQ(TcpPortOf("tcp://10.0.0.3:x"), std::nullopt);
  EXPECT_EQ(NumericAddressOf("tcp://10.0.0.3:7400"), "10.0.0.3");
  EXPECT_EQ(NumericAddressOf("tcp://localhost:7400"), "127.0.0.1");
  EXPECT_EQ(NumericAddressOf("tcp://[FE80:0::1]:7400"), "fe80::1");
  EXPECT_EQ(NumericAddressOf("tcp://rover1.local:7400"), "");
  EXPECT_EQ(NumericAddressOf(""), "");
}

}  // namespace
}  // namespace moondb
