// HttpServer: a small HTTP/1.1 server for one page and its data, on Boost.Beast. One thread serves all connections.
//
// Against other web sites that a user of the page visits: a request must name an allowed host (DNS rebinding), and if
// it states an origin, that origin's host must be allowed, too. Against clients that take too much: connections, sizes
// and times are limited. Refused requests and connections are counted.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

struct HttpRequest {
  std::string method;
  std::string path;                          // Without the query: "/tile".
  std::map<std::string, std::string> query;  // Names and values of the query, as sent.
  std::string content_type;
  std::string body;
};

struct HttpResponse {
  unsigned status = 200;
  std::string content_type = "application/json";
  std::shared_ptr<const std::string> body;
  bool is_deflated = false;  // `body` is compressed by zlib.
};

// The program's side of one WebSocket connection. Used on the server's thread alone.
class SocketPeer {
 public:
  struct Frame {
    std::string bytes;
    bool is_binary = false;
  };
  virtual ~SocketPeer() = default;
  virtual void OnMessage(const Frame& frame) = 0;
  // Returns the next frame to send; nullopt until the peer's `wake` is called.
  virtual std::optional<Frame> Next() = 0;
};

class HttpServer {
 public:
  static constexpr std::size_t kSocketMessageBytesMax = 64 * 1024;
  static constexpr std::size_t kHeaderBytesMax = 8192;
  static constexpr std::size_t kBodyBytesMax = 4096;

  struct Options {
    std::string address = "127.0.0.1";
    std::uint16_t port = 0;       // 0: any free port.
    std::set<std::string> hosts;  // Names that a request may use for this server, beside localhost and `address`.
    std::size_t connections_max = 200;
    // WebSockets at the path "/": the subprotocols in the order of preference. Others are refused.
    std::vector<std::string> subprotocols;
    // Makes the peer of a new connection. `wake` may be called on any thread while the server exists.
    std::function<std::unique_ptr<SocketPeer>(std::function<void()> wake)> make_peer;
    double socket_kbps = 0;  // Limit of the compressed bytes that one WebSocket sends, in kbit/s. 0: no limit.
  };
  struct Counts {
    std::uint64_t connections = 0;          // Open now.
    std::uint64_t refused_connections = 0;  // Beyond connections_max.
    std::uint64_t refused_requests = 0;     // Malformed, too large, or of a foreign host or origin.
  };

  // Call it at most once, on any thread. Requires: none exists any more when the server ends. A connection whose
  // Respond is destroyed without a call is closed.
  using Respond = std::function<void(HttpResponse)>;
  // Called on the server's thread, so it must not block. The methods are GET, HEAD and POST.
  using Handler = std::function<void(const HttpRequest&, Respond)>;

  // Fails with kUnavailable if the address cannot be used.
  static Result<std::unique_ptr<HttpServer>> Start(Options options, Handler handler);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  std::uint16_t port() const;
  Counts counts() const;  // Thread-safe.

 private:
  class Listener;
  explicit HttpServer(std::unique_ptr<Listener> listener);
  std::unique_ptr<Listener> listener_;
};

}  // namespace moondb
