// ZapHandler: decides which CURVE keys are admitted, and assigns a User-Id to each admitted connection (ZAP, ZeroMQ RFC
// 27).
//
// libzmq asks the handler during each handshake; without a handler, libzmq would admit every key. libzmq attaches the
// User-Id to each frame of the connection. On sockets of kAgentDomain, the User-Id is the id of the agent that owns the
// key. On sockets of kClientDomain, it is the client's key in Z85. For kNotNow, the answer is ZAP's temporary error,
// after which libzmq retries later.
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
  // Decides whether to admit a client with this key from the numeric address `address`.
  using AdmitClient = std::function<Admission(const std::string& key, const std::string& address)>;
  using OnRefused = std::function<void(bool is_client)>;

  // Binds ZAP's endpoint in `context`. Must be called before any socket of `context` uses CURVE. `agents` maps public
  // keys in Z85 to ids. Calls `on_refused` for each handshake with an unknown key, before the answer is sent.
  static Result<ZapHandler> Make(const ZmqContext& context, std::map<std::string, AgentId> agents,
                                 OnRefused on_refused);
  void LetClientsIn(AdmitClient admit_client) { admit_client_ = std::move(admit_client); }

  // Answers the waiting requests of libzmq.
  void OnReadable();
  int file() const { return socket_.file(); }

 private:
  ZapHandler(ZmqSocket socket, std::map<std::string, AgentId> agents, OnRefused on_refused)
      : socket_(std::move(socket)), agents_(std::move(agents)), on_refused_(std::move(on_refused)) {}

  struct Answer {
    Admission admission = Admission::kUnknown;
    std::string user_id;  // User-Id of an admitted key, otherwise empty.
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
