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
// in total and per client, and the bytes of answers on their way to one key (actors/gateway/client_budget.h). Requests
// of one key, or of another agent, for pages take turns (actors/gateway/page_turns.h). A restart of this actor loses
// all waiting requests; clients need timeouts of their own.
//
// The gateway itself returns these errors:
// - kCorrupt: the request does not decode;
// - kInvalid: the request violates a rule (actors/gateway/request_check.h);
// - kRefused: the client's key lacks the rights, the sending agent may not relay the request, or the request is for
//   another team or agent;
// - kFull: too many requests wait at the gateway or at the actor, the clients of the key have not read their answers,
//   or the request or reply is too long for the radio;
// - kUnavailable: the actor does not exist or failed, or the target agent cannot be reached or was lost;
// - kNotFound: the target of a custom request is not an actor of the user;
// - kTimedOut: the actor or the target agent did not answer.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "actors/gateway/client_budget.h"
#include "actors/gateway/command_log.h"
#include "actors/gateway/command_table.h"
#include "actors/gateway/feed.h"
#include "actors/gateway/page_turns.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/transport.h"

namespace moondb {

class GatewayActor final : public Actor {
 public:
  struct Options : ClientLimits {
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
    // Returns the bytes of answers that the clients of this connection's key have not acknowledged; 0 for a client over
    // ipc. Must be thread-safe. Called at most twice per request of a client with a key.
    std::function<std::uint64_t(const std::string& connection)> unread_bytes;
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
    std::string owner;        // The client to which the request counts (OwnerOf).
    std::uint64_t client_request_id = 0;
    proto::ControlRequest::RequestCase request = proto::ControlRequest::REQUEST_NOT_SET;
    AgentId relayed_to = 0;             // Agent whose gateway must answer; 0 if actors of this agent must answer.
    std::set<std::string> waiting_for;  // Names of the actors that have not answered yet.
    proto::ControlReply reply;          // Answers merged so far.
    TimerId timer = 0;
    bool is_wait = false;          // True if the request has wait_s.
    std::optional<Feed> feed;      // Set while a read with wait_s waits or is repeated.
    std::size_t answer_bytes = 0;  // Bytes with which the request counts while it is being answered.
    bool takes_turns = false;      // True if the request is sent to its actor only in its client's turn (PageTurns).
    std::string queue;             // Queue in turns_ that contains the request; empty if none does.
    std::optional<Question> question;  // The question to send when the turn begins; set while the request waits for it.
    // Text of the command in this agent's event log; empty if the request is not a command for this agent.
    std::string command;
    std::string by;  // Name of the client or agent that gave the command.
  };

  void OnControlRequest(Context& context, const proto::Message& message);
  void OnCheckedRequest(Context& context, const proto::Message& message, proto::ControlRequest request);
  // Sets the members of `pending` that concern the client's budget, and bounds the page of a read.
  void SetBudget(proto::ControlRequest& request, Pending& pending) const;
  // Returns the load of all requests but `pending`, as seen by the client of `pending`.
  ClientLoad LoadFor(const Pending& pending) const;
  // Returns kFull if the request would exceed a limit of waiting requests (Options) or of bytes (CheckAnswerBytes).
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
  void RequestFeed(Context& context, std::uint64_t id, Pending& pending);
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
  // Sends a question, or lets it wait until its client's earlier page request to the same actor is answered.
  Result<void> RequestInTurn(Context& context, Question question, std::uint64_t id, Pending& pending);
  // Ends the turn of a request, or its wait for one, and sends the client's next question.
  void EndTurn(Context& context, std::uint64_t id, Pending& pending);
  void CompleteStatus(Context& context, proto::AgentStatus& status) const;
  void Finish(Context& context, std::uint64_t id);
  void Answer(Context& context, const Address& client, std::uint64_t request_id, proto::ControlReply reply);
  // Returns the message for the client. Adds this agent's team id and team file hash, unless the reply already contains
  // the team id or the team file hash of another agent.
  proto::Message AnswerOf(std::uint64_t request_id, proto::ControlReply reply) const;

  Options options_;
  std::map<std::uint64_t, Pending> pending_;  // Keyed by this actor's own request id.
  PageTurns turns_;                           // Contains the requests in pending_ that have a queue.
  std::uint64_t next_id_ = 1;
  CommandLog log_;
  CommandLog refused_log_;
  proto::RoleAssignment roles_;                 // Roles as last published by RoleActor.
  std::uint64_t last_row_id_ = 0;               // Largest row id that StorageActor has published.
  double refused_requests_ = 0;                 // Number of client requests refused because of missing rights.
  std::map<AgentId, double> refused_commands_;  // Number of refused commands, by the agent that relayed them.
};

}  // namespace moondb
