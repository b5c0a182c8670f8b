// GatewayActor: the entry point for this agent's clients (moonctl, a robot's software, planners).
//
// Receives a Message{control_request}, checks the request, and forwards it to the actors that answer it
// (actors/gateway/command_table.h). Answers with Message{control_reply} under the client's request id. An actor's error
// is copied to ControlReply.error.
//
// A request for another agent (ControlRequest.for_agent) is relayed to that agent's gateway over the radio, and the
// answer is returned to the client. A request is relayed only once. CheckClientRights and CheckRelayRights
// (actors/gateway/client_rights.h) decide which requests are executed. A request for another team
// (ControlRequest.team_id) is refused. Commands are logged as events before they are executed
// (actors/gateway/command_log.h).
//
// A read with wait_s waits in the gateway (actors/gateway/feed.h). Other requests with wait_s wait at their actor; if
// that actor fails, the reply is kUnavailable. Each request has a timeout. The number of waiting requests is limited,
// in total and per client. A restart of this actor loses all waiting requests; clients need timeouts of their own.
//
// The gateway itself returns these errors:
// - kCorrupt: the request does not decode;
// - kInvalid: the request violates a rule (actors/gateway/request_check.h);
// - kRefused: the client's key lacks the rights, the sending agent may not relay the request, or the request is for
//   another team or agent;
// - kFull: too many requests wait at the gateway or at the actor, or the request or reply is too long for the radio;
// - kUnavailable: the actor does not exist or failed, or the target agent cannot be reached or was lost;
// - kNotFound: the target of a custom request is not an actor of the user;
// - kTimedOut: the actor or the target agent did not answer.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "actors/gateway/command_log.h"
#include "actors/gateway/feed.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/transport.h"

namespace moondb {

class GatewayActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;         // Requires: complete and validated.
    std::uint64_t config_hash = 0;  // TeamFile::hash, included in each reply.
    std::string version;            // Software version, shown in the status.
    std::uint32_t pid = 0;          // Process id, shown in the status.
    // Returns the merge backend for the status, "cpu" or "gl". Must be thread-safe. Called once per status.
    std::function<std::string()> merge_backend;
    // Returns the connections and messages that the transport refused, for the status.
    std::function<proto::ListenerStatus()> listener;
    // Names of the user's actors, to which clients may send custom requests.
    std::set<std::string> own_actors;
    std::size_t pending_max = 256;
    // Maximum number of pending requests per client: per key, connection or other agent.
    std::size_t pending_of_client_max = 64;
    // Maximum number of pending requests of one client that are relayed to the same agent. Replies cross the radio, and
    // must leave room for the replies to other clients.
    std::size_t relays_of_client_max = 8;
    std::size_t waits_max = 32;  // Maximum total number of pending requests with wait_s.
    // Maximum number of pending requests with wait_s per client.
    std::size_t waits_of_client_max = 8;
    // Maximum size of a relayed request or reply, in bytes. A message between agents also needs room for its envelope.
    std::size_t relay_bytes_max = kPeerMessageBytesMax - 1024;
    CommandLog::Options log = {};
    CommandLog::Options refused_log = {.event_kind = proto::EVENT_KIND_REJECTED, .commands_max = 2};
    Duration timeout = std::chrono::seconds(60);
    // Timeout for requests for which TakesLong is true (model/control_request.h).
    Duration long_timeout = std::chrono::seconds(600);
    // Delay between the reply to a stop request and the stop, so the reply can leave first.
    Duration stop_delay = std::chrono::milliseconds(50);
  };

  explicit GatewayActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  // A client's request that waits for actors of this agent or for another agent.
  struct Pending {
    Address client;
    std::string client_name;  // Name of the client's key; empty if the client has no key.
    std::uint64_t client_request_id = 0;
    proto::ControlRequest::RequestCase request = proto::ControlRequest::REQUEST_NOT_SET;
    AgentId relayed_to = 0;             // Agent whose gateway must answer; 0 if actors of this agent must answer.
    std::set<std::string> waiting_for;  // Names of the actors that have not answered yet.
    proto::ControlReply reply;          // Answers merged so far.
    TimerId timer = 0;
    bool is_wait = false;      // True if the request has wait_s.
    std::optional<Feed> feed;  // Set while a read with wait_s waits or is repeated.
    // Text of the command in this agent's event log; empty if the request is not a command for this agent.
    std::string command;
    std::string by;  // Name of the client or agent that gave the command.
  };

  void OnControlRequest(Context& context, const proto::Message& message);
  void OnCheckedRequest(Context& context, const proto::Message& message, proto::ControlRequest request);
  bool IsSameClient(const Pending& a, const Pending& b) const;
  // Returns kFull if the request would exceed a limit of waiting requests (Options).
  Result<void> CheckRoom(const Pending& pending) const;
  void OnStop(Context& context, const proto::Message& message);
  void OnAnswer(Context& context, const proto::Message& message);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnPeerLost(Context& context, AgentId peer);
  // Answers the requests that waited at `actor` with an error, because the failed actor has lost them.
  void OnActorLost(Context& context, const std::string& actor);
  // Answers each request for which `is_meant` is true with kUnavailable.
  void FailAll(Context& context, const std::function<bool(const Pending&)>& is_meant, const std::string& text);
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  // Handles the complete answer to `pending`. Returns false if the caller must send the reply to the client. Returns
  // true if `pending` is a feed with an empty page: the feed continues to wait, or has sent its read again.
  bool KeepsWaiting(Context& context, std::uint64_t id, Pending& pending);
  void AskFeed(Context& context, std::uint64_t id, Pending& pending);
  // Ends a feed whose wait_s has passed. Returns true if the caller must answer with an empty page. Returns false if a
  // read is in flight; the answer to that read then goes to the client.
  bool EndsFeed(Context& context, std::uint64_t id, Pending& pending);

  void RefuseRelayed(Context& context, const proto::Message& message, const proto::ControlRequest& request,
                     const Error& error);
  bool IsPeer(AgentId agent) const { return agent != kClients && agent != options_.self; }
  // Logs the command and returns the logged text. Returns "" and logs nothing if the request is not a command.
  std::string WriteDown(Context& context, const proto::ControlRequest& request);
  void WriteDownFailure(Context& context, const Pending& pending);
  void WriteDownRefused(Context& context, const std::string& text, const std::string& by);
  void Store(Context& context, const std::optional<proto::Record>& event) const;
  // Sends the request to all actors that must answer it. Returns kNotFound for an unknown custom actor, and kFull or
  // kUnavailable if an actor does not accept the message.
  Result<void> Forward(Context& context, proto::ControlRequest request, std::uint64_t id, Pending& pending);
  Result<void> Relay(Context& context, proto::ControlRequest request, std::uint64_t id, Pending& pending);
  Result<void> Ask(Context& context, const std::string& actor, proto::Message message, std::uint64_t id,
                   Pending& pending);
  void CompleteStatus(Context& context, proto::AgentStatus& status) const;
  void Finish(Context& context, std::uint64_t id);
  void Answer(Context& context, const Address& client, std::uint64_t request_id, proto::ControlReply reply);
  // Returns the message for the client. Adds this agent's team id and team file hash, unless the reply already contains
  // the team id or the team file hash of another agent.
  proto::Message AnswerOf(std::uint64_t request_id, proto::ControlReply reply) const;

  Options options_;
  std::map<std::uint64_t, Pending> pending_;  // Keyed by this actor's own request id.
  std::uint64_t next_id_ = 1;
  CommandLog log_;
  CommandLog refused_log_;
  proto::RoleAssignment roles_;                 // Roles as last published by RoleActor.
  std::uint64_t last_row_id_ = 0;               // Largest row id that StorageActor has published.
  double refused_requests_ = 0;                 // Number of client requests refused because of missing rights.
  std::map<AgentId, double> refused_commands_;  // Number of refused commands, by the agent that relayed them.
};

}  // namespace moondb
