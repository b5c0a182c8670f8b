#include "apps/moondb_view/http_server.h"

#include <atomic>
#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <optional>
#include <thread>
#include <utility>

#include "apps/moondb_view/board.h"
#include "model/text.h"

namespace moondb {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using asio::ip::tcp;

// Limits the bytes on the wire, after compression.
using LimitedStream = beast::basic_stream<tcp, asio::any_io_executor, beast::simple_rate_policy>;

// A browser keeps a connection for the next request.
constexpr auto kIdleMax = std::chrono::seconds(75);
// The largest answers take this long over 64 kbit/s.
constexpr auto kWriteMax = std::chrono::minutes(5);
constexpr int kUnansweredMax = 4;  // Frames on the way to one WebSocket.
constexpr auto kAcceptPause = std::chrono::milliseconds(100);
constexpr char kPolicy[] =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'";

// Returns the name of "name:port", "[::1]:port" or a URL of these.
std::string HostName(std::string text) {
  if (const auto scheme = text.find("://"); scheme != std::string::npos) text = text.substr(scheme + 3);
  if (text.starts_with('[')) return text.substr(0, text.find(']') + 1);
  return text.substr(0, text.find(':'));
}

HttpRequest ToRequest(const http::request<http::string_body>& message) {
  HttpRequest request;
  request.method = std::string(message.method_string());
  request.content_type = std::string(message[http::field::content_type]);
  request.body = message.body();
  const std::string target(message.target());
  const auto mark = target.find('?');
  request.path = target.substr(0, mark);
  if (mark == std::string::npos) return request;
  for (std::size_t at = mark + 1; at < target.size();) {
    const std::size_t end = std::min(target.find('&', at), target.size());
    const std::string pair = target.substr(at, end - at);
    const auto sign = pair.find('=');
    request.query[pair.substr(0, sign)] = sign == std::string::npos ? "" : pair.substr(sign + 1);
    at = end + 1;
  }
  return request;
}

HttpResponse Refusal(unsigned status, const std::string& text) {
  return {status, "text/plain; charset=utf-8", std::make_shared<const std::string>(text + "\n")};
}

}  // namespace

class HttpServer::Listener {
 public:
  Listener(Options options, Handler handler) : options_(std::move(options)), handler_(std::move(handler)) {}

  Result<void> Open() {
    beast::error_code error;
    const auto address = asio::ip::make_address(options_.address, error);
    if (error) return Fail(ErrorCode::kInvalid, "expected an IP address, got \"" + options_.address + "\"", "--listen");
    const tcp::endpoint endpoint(address, options_.port);
    acceptor_.open(endpoint.protocol(), error);
    if (!error) acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor_.bind(endpoint, error);
    if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
    if (error) {
      return Fail(ErrorCode::kUnavailable, "port " + std::to_string(options_.port) + " of " + options_.address +
                                               " cannot be used: " + error.message() + "; choose another --port");
    }
    port_ = acceptor_.local_endpoint().port();
    return {};
  }

  void Run() {
    Accept();
    thread_ = std::thread([this] { io_.run(); });
  }

  void End() {
    io_.stop();
    if (thread_.joinable()) thread_.join();
  }

  std::uint16_t port() const { return port_; }
  Counts counts() const { return {connections_, refused_connections_, refused_requests_}; }

 private:
  class Session;
  class SocketSession;

  void Accept();

  bool IsAllowed(const http::request<http::string_body>& message) const {
    const auto is_known = [this](const std::string& text) {
      const std::string name = HostName(text);
      return name == "localhost" || name == "127.0.0.1" || name == "[::1]" || name == options_.address ||
             options_.hosts.contains(name);
    };
    if (!is_known(std::string(message[http::field::host]))) return false;
    const auto origin = message.find(http::field::origin);
    return origin == message.end() || is_known(std::string(origin->value()));
  }

  // Returns the most preferred subprotocol that the request offers. Empty: none, or another path.
  std::string ChooseSubprotocol(const http::request<http::string_body>& message) const {
    if (!options_.make_peer || message.target() != "/") return "";
    const std::string offered(message[http::field::sec_websocket_protocol]);
    for (const std::string& wanted : options_.subprotocols) {
      for (const auto& token : http::token_list(offered)) {
        if (token == wanted) return wanted;
      }
    }
    return "";
  }

  const Options options_;
  const Handler handler_;
  std::uint16_t port_ = 0;
  std::atomic<std::uint64_t> connections_ = 0;
  std::atomic<std::uint64_t> refused_connections_ = 0;
  std::atomic<std::uint64_t> refused_requests_ = 0;
  asio::io_context io_{1};  // Owns the sessions, which use the members above.
  tcp::acceptor acceptor_{io_};
  asio::steady_timer accept_again_{io_};
  std::thread thread_;
};

// One WebSocket. It asks its peer for the next frame only when the last one is sent, so nothing queues up here.
class HttpServer::Listener::SocketSession : public std::enable_shared_from_this<SocketSession> {
 public:
  SocketSession(Listener& listener, tcp::socket socket) : listener_(listener), socket_(std::move(socket)) {
    ++listener_.connections_;
    if (const double kbps = listener_.options_.socket_kbps; kbps > 0) {
      beast::get_lowest_layer(socket_).rate_policy().write_limit(static_cast<std::size_t>(kbps * 125));
    }
  }
  ~SocketSession() { --listener_.connections_; }

  void Start(const http::request<http::string_body>& request, const std::string& subprotocol) {
    beast::get_lowest_layer(socket_).expires_never();  // The WebSocket has timeouts of its own, with pings.
    socket_.set_option(websocket::stream_base::timeout::suggested(beast::role_type::server));
    socket_.set_option(websocket::stream_base::decorator([subprotocol](websocket::response_type& response) {
      response.set(http::field::sec_websocket_protocol, subprotocol);
    }));
    websocket::permessage_deflate deflate;
    deflate.server_enable = true;
    deflate.compLevel = 1;
    deflate.memLevel = 5;
    socket_.set_option(deflate);
    socket_.read_message_max(kSocketMessageBytesMax);
    socket_.control_callback([this](websocket::frame_type kind, beast::string_view) {
      if (kind != websocket::frame_type::pong || unanswered_ == 0) return;
      --unanswered_;
      asio::post(socket_.get_executor(), [self = shared_from_this()] { self->Write(); });  // Not within a read.
    });
    peer_ = listener_.options_.make_peer([weak = weak_from_this()] {
      if (auto self = weak.lock()) {
        // Moved, so that this thread never destroys the session.
        const auto executor = self->socket_.get_executor();
        asio::post(executor, [self = std::move(self)] { self->Write(); });
      }
    });
    request_ = request;
    socket_.async_accept(request_, [self = shared_from_this()](beast::error_code error) {
      if (error) return;
      self->is_open_ = true;
      self->Read();
      self->Write();
    });
  }

 private:
  void Read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) {
        if (error == websocket::error::message_too_big) ++self->listener_.refused_requests_;
        self->is_open_ = false;
        return;
      }
      self->peer_->OnMessage({beast::buffers_to_string(self->buffer_.data()), self->socket_.got_binary()});
      self->buffer_.consume(self->buffer_.size());
      self->Write();
      self->Read();
    });
  }

  void Write() {
    if (!is_open_ || is_writing_ || unanswered_ >= kUnansweredMax) return;
    std::optional<SocketPeer::Frame> frame = peer_->Next();
    if (!frame) return;
    is_writing_ = true;
    frame_ = *std::move(frame);
    socket_.binary(frame_.is_binary);
    socket_.async_write(asio::buffer(frame_.bytes), [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (!error) self->Ping();
    });
  }

  // The answer says that the viewer has taken the frame. Without it, a link that is cut would later deliver all that
  // the buffers of the network took meanwhile.
  void Ping() {
    ++unanswered_;
    socket_.async_ping({}, [self = shared_from_this()](beast::error_code error) {
      self->is_writing_ = false;
      if (!error) self->Write();
    });
  }

  Listener& listener_;
  websocket::stream<LimitedStream> socket_;
  http::request<http::string_body> request_;
  beast::flat_buffer buffer_;
  std::unique_ptr<SocketPeer> peer_;
  SocketPeer::Frame frame_;
  int unanswered_ = 0;  // Pings.
  bool is_open_ = false;
  bool is_writing_ = false;
};

// One connection, which answers its requests one after another.
class HttpServer::Listener::Session : public std::enable_shared_from_this<Session> {
 public:
  Session(Listener& listener, tcp::socket socket) : listener_(listener), stream_(std::move(socket)) {
    ++listener_.connections_;
  }
  ~Session() { --listener_.connections_; }

  void Read() {
    parser_.emplace();
    parser_->header_limit(kHeaderBytesMax);
    parser_->body_limit(kBodyBytesMax);
    stream_.expires_after(kIdleMax);
    http::async_read(stream_, buffer_, *parser_,
                     [self = shared_from_this()](beast::error_code error, std::size_t) { self->OnRead(error); });
  }

 private:
  void OnRead(beast::error_code error) {
    if (error == http::error::end_of_stream || error == beast::error::timeout) return;
    // Errors of the parser are faults of the request; others are a broken connection.
    if (error && error.category() != http::make_error_code(http::error::bad_target).category()) return;
    if (error)
      return Refuse(error == http::error::body_limit     ? 413
                    : error == http::error::header_limit ? 431
                                                         : 400,
                    "the request is malformed or too large");
    const http::request<http::string_body>& message = parser_->get();
    is_head_ = message.method() == http::verb::head;
    accepts_deflate_ = message[http::field::accept_encoding].find("deflate") != beast::string_view::npos;
    is_kept_ = message.keep_alive();
    if (!listener_.IsAllowed(message)) return Refuse(403, "the host or the origin is not allowed: see --allow-host");
    if (websocket::is_upgrade(message)) return Upgrade(message);
    listener_.handler_(ToRequest(message), [self = shared_from_this()](HttpResponse response) {
      asio::post(self->stream_.get_executor(),
                 [self, response = std::move(response)]() mutable { self->Write(std::move(response)); });
    });
  }

  void Upgrade(const http::request<http::string_body>& message) {
    const std::string subprotocol = listener_.ChooseSubprotocol(message);
    if (subprotocol.empty()) return Refuse(400, "expected a WebSocket at / with a subprotocol of Foxglove");
    std::make_shared<SocketSession>(listener_, stream_.release_socket())->Start(message, subprotocol);
  }

  void Refuse(unsigned status, const std::string& text) {
    ++listener_.refused_requests_;
    is_kept_ = false;
    Write(Refusal(status, text));
  }

  void Write(HttpResponse content) {
    std::shared_ptr<const std::string> body = content.body;
    if (content.is_deflated && !accepts_deflate_) {
      const Result<std::string> inflated = Inflate(*body);
      if (!inflated) return Write(Refusal(500, inflated.error().text));
      body = std::make_shared<const std::string>(*inflated);
      content.is_deflated = false;
    }
    response_.emplace(static_cast<http::status>(content.status), 11);
    response_->set(http::field::content_type, content.content_type);
    response_->set(http::field::cache_control, "no-store");
    response_->set("Content-Security-Policy", kPolicy);
    response_->set("X-Content-Type-Options", "nosniff");
    response_->set("Referrer-Policy", "no-referrer");
    response_->set("Cross-Origin-Resource-Policy", "same-origin");
    if (content.is_deflated) response_->set(http::field::content_encoding, "deflate");
    response_->content_length(body->size());
    response_->keep_alive(is_kept_);
    if (!is_head_) response_->body() = *body;
    stream_.expires_after(kWriteMax);
    http::async_write(stream_, *response_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (!error && self->is_kept_) return self->Read();
      beast::error_code ignored;  // The other side may be gone.
      self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    });
  }

  Listener& listener_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_{kHeaderBytesMax + kBodyBytesMax};
  std::optional<http::request_parser<http::string_body>> parser_;
  std::optional<http::response<http::string_body>> response_;
  bool is_head_ = false;
  bool is_kept_ = false;
  bool accepts_deflate_ = false;
};

void HttpServer::Listener::Accept() {
  acceptor_.async_accept([this](beast::error_code error, tcp::socket socket) {
    if (error) {
      // For example, the process has no descriptor left.
      accept_again_.expires_after(kAcceptPause);
      return accept_again_.async_wait([this](beast::error_code) { Accept(); });
    }
    if (connections_ < options_.connections_max) {
      std::make_shared<Session>(*this, std::move(socket))->Read();
    } else {
      ++refused_connections_;  // `socket` closes.
    }
    Accept();
  });
}

Result<std::unique_ptr<HttpServer>> HttpServer::Start(Options options, Handler handler) {
  auto listener = std::make_unique<Listener>(std::move(options), std::move(handler));
  if (const Result<void> opened = listener->Open(); !opened) return tl::unexpected(opened.error());
  listener->Run();
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(listener)));
}

HttpServer::HttpServer(std::unique_ptr<Listener> listener) : listener_(std::move(listener)) {}
HttpServer::~HttpServer() { listener_->End(); }
std::uint16_t HttpServer::port() const { return listener_->port(); }
HttpServer::Counts HttpServer::counts() const { return listener_->counts(); }

}  // namespace moondb
