// ZapHandler: says whose CURVE keys may come in, and under which name (ZeroMQ RFC 27).
//
// libzmq asks it by inproc messages during each handshake; without it, every key would be let in. A key that belongs to
// an agent gets that agent's id as User-Id, which libzmq then attaches to each frame of the connection. At a socket of
// the domain kClientDomain clients' keys are let in instead, with the key itself (Z85) as User-Id. Those that are
// refused for now get ZAP's temporary error, upon which libzmq connects again later.
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
  // `address`: from where the client connects, in numbers.
  using AdmitClient = std::function<Admission(const std::string& key, const std::string& address)>;
  using OnRefused = std::function<void(bool is_client)>;

  // Binds in `context`; before any socket that uses CURVE. `agents` is by public key in Z85. Calls `on_refused` for
  // each handshake of an unknown key before it answers, so a peer that sees its refusal has been counted.
  static Result<ZapHandler> Make(const ZmqContext& context, std::map<std::string, AgentId> agents,
                                 OnRefused on_refused);
  void LetClientsIn(AdmitClient admit_client) { admit_client_ = std::move(admit_client); }

  // Answers what waits.
  void OnReadable();
  int file() const { return socket_.file(); }

 private:
  ZapHandler(ZmqSocket socket, std::map<std::string, AgentId> agents, OnRefused on_refused)
      : socket_(std::move(socket)), agents_(std::move(agents)), on_refused_(std::move(on_refused)) {}

  struct Answer {
    Admission admission = Admission::kUnknown;
    std::string user_id;  // Of the key that asks, if it is admitted.
  };
  Answer Ask(const std::vector<ZmqFrame>& request) const;

  ZmqSocket socket_;
  std::map<std::string, AgentId> agents_;
  AdmitClient admit_client_;
  OnRefused on_refused_;
};

// The agent that a User-Id stands for; 0 for none.
AgentId AgentOfUserId(std::string_view user_id);

}  // namespace moondb
