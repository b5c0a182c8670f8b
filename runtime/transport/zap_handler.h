// ZapHandler: decides which CURVE keys are admitted, and sets their user ids (ZeroMQ RFC 27).
//
// libzmq asks the handler by inproc messages during each handshake; without a handler, libzmq would admit every key.
// The key of an agent gets the agent's id as User-Id, which libzmq attaches to each frame of the connection. On sockets
// of the domain kClientDomain, keys of clients are admitted instead, with the key itself (Z85) as User-Id. A temporary
// refusal uses ZAP's temporary error, after which libzmq retries later.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb {

class ZapHandler {
 public:
  static constexpr char kAgentDomain[] = "moondb";
  static constexpr char kClientDomain[] = "moondb-clients";
  enum class Admission { kAdmitted, kUnknown, kNotNow };
  // `address` is the client's numeric address.
  using AdmitClient = std::function<Admission(const std::string& key, const std::string& address)>;
  using OnRefused = std::function<void(bool is_client)>;

  // Binds in `context`; must be called before any socket uses CURVE. `agents` maps public keys in Z85 to ids. Calls
  // `on_refused` for each handshake with an unknown key, before the answer is sent. When a peer receives a refusal, the
  // refusal has thus already been counted.
  static Result<ZapHandler> Make(const ZmqContext& context, std::map<std::string, AgentId> agents,
                                 OnRefused on_refused);
  void LetClientsIn(AdmitClient admit_client) { admit_client_ = std::move(admit_client); }

  // Answers the waiting requests.
  void OnReadable();
  int file() const { return socket_.file(); }

 private:
  ZapHandler(ZmqSocket socket, std::map<std::string, AgentId> agents, OnRefused on_refused)
      : socket_(std::move(socket)), agents_(std::move(agents)), on_refused_(std::move(on_refused)) {}

  struct Answer {
    Admission admission = Admission::kUnknown;
    std::string user_id;  // User-Id of the key, if it is admitted.
  };
  Answer Ask(const std::vector<ZmqFrame>& request) const;

  ZmqSocket socket_;
  std::map<std::string, AgentId> agents_;
  AdmitClient admit_client_;
  OnRefused on_refused_;
};

// Returns the agent of a User-Id, or 0 if the User-Id names no agent.
AgentId AgentOfUserId(std::string_view user_id);

}  // namespace moondb
