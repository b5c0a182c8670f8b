// Tests the server over loopback, at ports that the kernel chooses. Each wait has a limit of a minute.
#include "apps/moondb_view/http_server.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <thread>
#include <vector>

#include "apps/moondb_view/board.h"

namespace moondb {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class Connection {
 public:
  explicit Connection(std::uint16_t port) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    const timeval limit{60, 0};
    (void)::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    (void)::connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof address);
  }
  ~Connection() { ::close(socket_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void Send(const std::string& text) { (void)!::send(socket_, text.data(), text.size(), MSG_NOSIGNAL); }
  // Returns the bytes up to the end of `end`, or all that came before the connection closed. Keeps later bytes.
  std::string ReadUntil(const std::string& end) {
    while (text_.find(end) == std::string::npos && Receive()) {
    }
    const std::size_t place = text_.find(end);
    return Cut(place == std::string::npos ? text_.size() : place + end.size());
  }
  std::string ReadToEnd() {
    while (Receive()) {
    }
    return Cut(text_.size());
  }
  std::string ReadBytes(std::size_t size) {
    while (text_.size() < size && Receive()) {
    }
    return Cut(std::min(size, text_.size()));
  }

 private:
  bool Receive() {
    char part[4096];
    const ssize_t size = ::recv(socket_, part, sizeof part, 0);
    if (size > 0) text_.append(part, static_cast<std::size_t>(size));
    return size > 0;
  }
  std::string Cut(std::size_t size) {
    std::string cut = text_.substr(0, size);
    text_.erase(0, size);
    return cut;
  }

  int socket_;
  std::string text_;
};

class HttpServerTest : public testing::Test {
 protected:
  void Start(HttpServer::Options options = {}) {
    server_ = HttpServer::Start(std::move(options), [this](const HttpRequest& request, HttpServer::Respond respond) {
                requests_.push_back(request);
                if (request.path == "/drop") return;
                respond({200, "text/plain", std::make_shared<const std::string>(Deflate("hello")), true});
              }).value();
  }

  std::string Ask(const std::string& headers, const std::string& target = "/", const std::string& method = "GET") {
    Connection connection(server_->port());
    connection.Send(method + " " + target + " HTTP/1.1\r\nConnection: close\r\n" + headers + "\r\n");
    return connection.ReadToEnd();
  }

  std::vector<HttpRequest> requests_;  // Read it once an answer has come.
  std::unique_ptr<HttpServer> server_;
};

TEST_F(HttpServerTest, AnswersCompressedAndPlain) {
  Start();
  const std::string plain = Ask("Host: localhost\r\n", "/tile?x=-1&y=2&v");
  EXPECT_THAT(plain, StartsWith("HTTP/1.1 200 OK\r\n"));
  EXPECT_THAT(plain, EndsWith("\r\n\r\nhello"));
  EXPECT_THAT(plain, HasSubstr("Content-Security-Policy: default-src 'none';"));
  ASSERT_EQ(requests_.size(), 1u);
  EXPECT_EQ(requests_[0].path, "/tile");
  EXPECT_EQ(requests_[0].query, (std::map<std::string, std::string>{{"x", "-1"}, {"y", "2"}, {"v", ""}}));
  const std::string compressed = Ask("Host: localhost\r\nAccept-Encoding: gzip, deflate\r\n");
  EXPECT_THAT(compressed, HasSubstr("Content-Encoding: deflate\r\n"));
  EXPECT_THAT(compressed, EndsWith(Deflate("hello")));
  EXPECT_THAT(Ask("Host: localhost\r\n", "/", "HEAD"), EndsWith("\r\n\r\n"));
}

TEST_F(HttpServerTest, AnswersRequestsOfOneConnectionInTurn) {
  Start();
  Connection connection(server_->port());
  const std::string request = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";
  connection.Send(request + request);
  EXPECT_THAT(connection.ReadUntil("hello"), HasSubstr("200 OK"));
  connection.Send(request);
  EXPECT_THAT(connection.ReadUntil("hello"), HasSubstr("200 OK"));
}

TEST_F(HttpServerTest, RefusesForeignHostsAndOrigins) {
  HttpServer::Options options;
  options.hosts = {"robots.example"};
  Start(options);
  for (const char* host : {"localhost", "localhost:9000", "127.0.0.1:8600", "[::1]:8600", "robots.example:80"}) {
    EXPECT_THAT(Ask("Host: " + std::string(host) + "\r\n"), HasSubstr("200 OK")) << host;
    EXPECT_THAT(Ask("Host: localhost\r\nOrigin: http://" + std::string(host) + "\r\n"), HasSubstr("200 OK")) << host;
  }
  const std::size_t answered = requests_.size();
  for (const char* host : {"evil.example", "127.0.0.1.evil.example", "localhost.evil.example", "", "[::2]"}) {
    EXPECT_THAT(Ask("Host: " + std::string(host) + "\r\n"), HasSubstr("403 Forbidden")) << host;
    EXPECT_THAT(Ask("Host: localhost\r\nOrigin: http://" + std::string(host) + "\r\n"), HasSubstr("403 Forbidden"))
        << host;
  }
  EXPECT_THAT(Ask(""), HasSubstr("403 Forbidden")) << "no host";
  EXPECT_THAT(Ask("Host: localhost\r\nOrigin: null\r\n"), HasSubstr("403 Forbidden"));
  EXPECT_EQ(requests_.size(), answered);
  EXPECT_EQ(server_->counts().refused_requests, 12u);
}

TEST_F(HttpServerTest, RefusesMalformedAndOversizedRequests) {
  Start();
  Connection garbage(server_->port());
  garbage.Send("\x16\x03\x01 nonsense\r\n\r\n");
  EXPECT_THAT(garbage.ReadToEnd(), HasSubstr("400 Bad Request"));
  EXPECT_THAT(Ask("Host: localhost\r\nCookie: " + std::string(HttpServer::kHeaderBytesMax, 'x') + "\r\n"),
              HasSubstr("431 "));
  EXPECT_THAT(Ask("Host: localhost\r\nContent-Length: 100000\r\n", "/", "POST"), HasSubstr("413 "));
  EXPECT_TRUE(requests_.empty());
  EXPECT_EQ(server_->counts().refused_requests, 3u);
}

TEST_F(HttpServerTest, ClosesConnectionsBeyondTheLimit) {
  HttpServer::Options options;
  options.connections_max = 2;
  Start(options);
  {
    Connection first(server_->port());
    Connection second(server_->port());
    for (Connection* connection : {&first, &second}) {
      connection->Send("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
      EXPECT_THAT(connection->ReadUntil("hello"), HasSubstr("200 OK"));
    }
    EXPECT_EQ(server_->counts().connections, 2u);
    EXPECT_EQ(Connection(server_->port()).ReadToEnd(), "");
    EXPECT_EQ(server_->counts().refused_connections, 1u);
  }
  // The server notices that they are closed.
  while (Ask("Host: localhost\r\n").empty()) {
  }
}

TEST_F(HttpServerTest, ClosesAConnectionWithoutAnswer) {
  Start();
  EXPECT_EQ(Ask("Host: localhost\r\n", "/drop"), "");
}

class EchoPeer : public SocketPeer {
 public:
  void OnMessage(const Frame& frame) override { echo_ = frame; }
  std::optional<Frame> Next() override { return std::exchange(echo_, std::nullopt); }

 private:
  std::optional<Frame> echo_;
};

constexpr char kUpgrade[] =
    "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n";

TEST_F(HttpServerTest, ChoosesAmongTheOfferedSubprotocols) {
  HttpServer::Options options;
  options.subprotocols = {"b", "a"};
  options.make_peer = [](const std::function<void()>&) { return std::make_unique<EchoPeer>(); };
  Start(options);
  const auto upgrade = [this](const std::string& more) {
    Connection connection(server_->port());
    connection.Send(kUpgrade + more + "\r\n");
    return connection.ReadUntil("\r\n\r\n");
  };
  EXPECT_THAT(upgrade("Sec-WebSocket-Protocol: a\r\n"), HasSubstr("Sec-WebSocket-Protocol: a\r\n"));
  EXPECT_THAT(upgrade("Sec-WebSocket-Protocol: c, a, b\r\n"), HasSubstr("Sec-WebSocket-Protocol: b\r\n"));
  EXPECT_THAT(upgrade("Sec-WebSocket-Protocol: c\r\n"), HasSubstr("400 Bad Request"));
  EXPECT_THAT(upgrade(""), HasSubstr("400 Bad Request"));
  EXPECT_THAT(upgrade("Sec-WebSocket-Protocol: a\r\nOrigin: http://evil.example\r\n"), HasSubstr("403 Forbidden"));
}

TEST_F(HttpServerTest, ExchangesMessagesAndClosesOversizedOnes) {
  HttpServer::Options options;
  options.subprotocols = {"a"};
  options.make_peer = [](const std::function<void()>&) { return std::make_unique<EchoPeer>(); };
  Start(options);
  {
    Connection connection(server_->port());
    connection.Send(std::string(kUpgrade) + "Sec-WebSocket-Protocol: a\r\n\r\n");
    EXPECT_THAT(connection.ReadUntil("\r\n\r\n"), HasSubstr("101 Switching Protocols"));
    // A text of 5 bytes, masked by zeros.
    connection.Send(std::string("\x81\x85\0\0\0\0hello", 11));
    EXPECT_EQ(connection.ReadBytes(9), std::string("\x81\x05hello\x89\0", 9)) << "with a ping";
    // A text that claims 1 MiB.
    connection.Send(std::string("\x81\xff\0\0\0\0\0\x10\0\0\0\0\0\0", 14));
    EXPECT_THAT(connection.ReadToEnd(), StartsWith("\x88"));
  }
  // The server counts it once the connection has ended.
  while (server_->counts().refused_requests == 0) std::this_thread::yield();
}

// Has a frame whenever it is asked.
class EndlessPeer : public SocketPeer {
 public:
  void OnMessage(const Frame&) override {}
  std::optional<Frame> Next() override { return Frame{"frame", false}; }
};

TEST_F(HttpServerTest, SendsNoMoreThanTheViewerConfirms) {
  HttpServer::Options options;
  options.subprotocols = {"a"};
  options.make_peer = [](const std::function<void()>&) { return std::make_unique<EndlessPeer>(); };
  Start(options);
  Connection connection(server_->port());
  connection.Send(std::string(kUpgrade) + "Sec-WebSocket-Protocol: a\r\n\r\n");
  EXPECT_THAT(connection.ReadUntil("\r\n\r\n"), HasSubstr("101 Switching Protocols"));
  const std::string frame_and_ping("\x81\5frame\x89\0", 9);
  std::string expected;
  for (int i = 0; i < 4; ++i) expected += frame_and_ping;
  EXPECT_EQ(connection.ReadBytes(expected.size()), expected);
  connection.Send(std::string("\x8a\x80\0\0\0\0", 6));  // A pong, masked by zeros.
  EXPECT_EQ(connection.ReadBytes(frame_and_ping.size()), frame_and_ping);
  connection.Send(std::string("\x88\x80\0\0\0\0", 6));  // The end.
  EXPECT_THAT(connection.ReadToEnd(), StartsWith("\x88")) << "only one frame for one answer";
}

TEST_F(HttpServerTest, SaysWhichPortIsTaken) {
  Start();
  HttpServer::Options options;
  options.port = server_->port();
  const auto second = HttpServer::Start(options, {});
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(second.error().text, HasSubstr("choose another --port"));
  options.address = "rover1";
  EXPECT_EQ(HttpServer::Start(options, {}).error().code, ErrorCode::kInvalid);
}

}  // namespace
}  // namespace moondb
