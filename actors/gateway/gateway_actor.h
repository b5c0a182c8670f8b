// GatewayActor: where clients (moonctl, a robot's software, planners) reach this agent.
//
// Takes Message{control_request} from clients, parses it (once; model/control_message.h), checks it, hands it to the
// actor whose duty it is under a request id of its own, and answers with Message{control_reply} under the client's
// (actors/gateway/command_table.h). An error of the reply inside is copied to ControlReply.error, so that a client has
// one place to look. Status is put together here from the parts of StorageActor, RoleActor, LeaseActor and EventActor,
// and what the system knows.
//
// A request for another agent of the team (ControlRequest.for_agent) goes to that one's gateway over the radio, and its
// answer comes back: so an operator at the base station reaches the whole team. No request travels further than from
// one agent to another, and what changes anything is obeyed only from those that command_from of the team file names
// (CheckRelayRights). What is short goes in the control class; what is longer waits behind everything that is shared,
// and nothing is longer than `relay_bytes_max`.
//
// A client that came with a key may ask what its rights allow (actors/gateway/client_rights.h), here and of other
// agents through here; kRefused for the rest.
//
// A request for another team (ControlRequest.team_id) is refused before anything comes of it, here and at the agent
// that it is relayed to; each answer says whose it is, by team and team file.
//
// What somebody ordered is written down as an event (actors/gateway/command_log.h), before it is done. Who it was, a
// client with a key does not say itself: "anna (key)" stands there, by its key's name, at the agent that checked the
// key; another one that it is relayed to knows no more than that agent's word, and writes "anna". What another agent
// ordered and may not is written down as refused, so many in a minute.
//
// A request to share, or to change roles, with wait_s waits at the actor that carries it out. If that actor fails, the
// answer is kUnavailable, since the actor forgets the requests that wait.
//
// A read with wait_s is a feed: where nothing is there yet it is kept here (actors/gateway/feed.h) until the time is
// up; then its answer is an empty page. Nothing is queued for a client: one that is slow asks later.
//
// What waits for an answer is bounded: `pending_max` requests, each with a timeout, and so many of one client that
// others have their share: one key counts as one client, over however many connections. Errors that clients see from
// here: kCorrupt (the request does not decode), kInvalid (actors/gateway/request_check.h), kRefused (another agent sent
// a request that is not for this one), kFull (too much waits, here or at the actor; an answer too long for the radio),
// kUnavailable (no such actor; the agent that it is for cannot be reached, or was lost), kNotFound (a custom request to
// what is no actor of the user's), kTimedOut (the actor, or the other agent, did not answer). After a restart of this
// actor what waited is forgotten; the clients' own timeouts tell them.
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
    proto::TeamConfig team;                           // Complete and checked.
    std::uint64_t config_hash = 0;                    // TeamFile::hash; in each answer.
    std::string version;                              // Shown in status.
    std::uint32_t pid = 0;                            // Shown in status.
    std::function<std::string()> merge_backend;       // Shown in status: "cpu" or "gl"; asked each time, on any thread.
    std::function<proto::ListenerStatus()> listener;  // Shown in status: what the transport refused.
    std::set<std::string> own_actors;                 // The user's; clients may ask these by name.
    std::size_t pending_max = 256;
    std::size_t pending_of_client_max = 64;  // So many of one key, connection or other agent.
    // Of these, so many to one other agent: its answers cross the radio, and others' have to find room there.
    std::size_t relays_of_client_max = 8;
    std::size_t waits_max = 32;           // The part of pending_max that requests with wait_s may use.
    std::size_t waits_of_client_max = 8;  // The part of waits_max that one key, connection or agent may use.
    // Of a request or answer over the radio: two seconds of it. A message between agents holds it and its envelope.
    std::size_t relay_bytes_max = kPeerMessageBytesMax - 1024;
    CommandLog::Options log = {};
    CommandLog::Options refused_log = {.event_kind = proto::EVENT_KIND_REJECTED, .commands_max = 2};
    Duration timeout = std::chrono::seconds(60);
    Duration long_timeout = std::chrono::seconds(600);    // Of what TakesLong (model/control_request.h).
    Duration stop_delay = std::chrono::milliseconds(50);  // From the reply to a stop until the stop: it must leave.
  };

  explicit GatewayActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  // A client's request that waits for one or more actors of this agent.
  struct Pending {
    Address client;
    std::string client_name;  // Of its key; empty: it has none.
    std::uint64_t client_request_id = 0;
    proto::ControlRequest::RequestCase request = proto::ControlRequest::REQUEST_NOT_SET;
    AgentId relayed_to = 0;             // Its gateway is waited for; 0: actors of this agent.
    std::set<std::string> waiting_for;  // Names of actors.
    proto::ControlReply reply;          // As far as it is known.
    TimerId timer = 0;
    bool is_wait = false;      // The request has wait_s.
    std::optional<Feed> feed;  // Waits, or is being asked anew.
    std::string command;       // The text in the event log of a command for this agent; empty: there is none.
    std::string by;            // The command's giver, as in the event log.
  };

  void OnControlRequest(Context& context, const proto::Message& message);
  void OnCheckedRequest(Context& context, const proto::Message& message, proto::ControlRequest request);
  bool IsSameClient(const Pending& a, const Pending& b) const;
  // kFull where the client, or all together, may not wait for one answer more.
  Result<void> CheckRoom(const Pending& pending) const;
  void OnStop(Context& context, const proto::Message& message);
  void OnAnswer(Context& context, const proto::Message& message);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnPeerLost(Context& context, AgentId peer);
  // That actor of this agent failed, and forgot the requests that wait there.
  void OnActorLost(Context& context, const std::string& actor);
  // Answers each of these with kUnavailable.
  void FailAll(Context& context, const std::function<bool(const Pending&)>& is_meant, const std::string& text);
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  // The answer of storage was empty: true if the feed goes on waiting, or asks again.
  bool KeepsWaiting(Context& context, std::uint64_t id, Pending& pending);
  void AskFeed(Context& context, std::uint64_t id, Pending& pending);
  // True if it has come to its end, with an empty page; else storage's answer, under way now, is its last.
  bool EndsFeed(Context& context, std::uint64_t id, Pending& pending);

  void RefuseRelayed(Context& context, const proto::Message& message, const proto::ControlRequest& request,
                     const Error& error);
  bool IsPeer(AgentId agent) const { return agent != kClients && agent != options_.self; }
  // The text in the event log; empty: the request is no command, and not written down.
  std::string WriteDown(Context& context, const proto::ControlRequest& request);
  void WriteDownFailure(Context& context, const Pending& pending);
  void WriteDownRefused(Context& context, const std::string& text, const std::string& by);
  void Store(Context& context, const std::optional<proto::Record>& event) const;
  // Sends the request on to those who have parts of the answer; fails without a trace in pending_.
  Result<void> Forward(Context& context, proto::ControlRequest request, std::uint64_t id, Pending& pending);
  Result<void> Relay(Context& context, proto::ControlRequest request, std::uint64_t id, Pending& pending);
  Result<void> Ask(Context& context, const std::string& actor, proto::Message message, std::uint64_t id,
                   Pending& pending);
  void CompleteStatus(Context& context, proto::AgentStatus& status) const;
  void Finish(Context& context, std::uint64_t id);
  void Answer(Context& context, const Address& client, std::uint64_t request_id, proto::ControlReply reply);
  // Says whose answer it is, unless another agent that was asked has said so.
  proto::Message AnswerOf(std::uint64_t request_id, proto::ControlReply reply) const;

  Options options_;
  std::map<std::uint64_t, Pending> pending_;  // By own request id.
  std::uint64_t next_id_ = 1;
  CommandLog log_;
  CommandLog refused_log_;
  proto::RoleAssignment roles_;                 // As RoleActor published them last.
  std::uint64_t last_row_id_ = 0;               // As StorageActor published it last.
  double refused_requests_ = 0;                 // Of clients, for want of rights.
  std::map<AgentId, double> refused_commands_;  // Of other agents, likewise.
};

}  // namespace moondb
