// EventActor ("event"): writes down what happened at this agent, as records of the type `agent_event`.
//
// It logs that the agent started; each change of roles that this agent issued; and, once a minute, what went wrong
// since the last time: actors that failed and were made anew, records and messages that were refused or damaged,
// sharing sessions that ended early. What happens a thousand times in a minute is one event with a count: a flood from
// outside never becomes a flood of records. Commands are GatewayActor's to write down.
//
// A peer that was connected and is not for `lost_after` is lost, unless it or this agent said that it sleeps or, in a
// team that is quiet while driving, drives: that is an event under the time at which it was lost, once a loss, and its
// return another; of one peer at most one loss in `lost_again_after`.
//
// Losses and damage are findings (model/event.h) until an operator acknowledges them. What they are, the events in the
// store say (actors/storage/findings.h): this actor asks StorageActor after each that it wrote down, and answers the
// ControlRequest `status` with what storage answered, as its part of AgentStatus. An AcknowledgeRequest is answered
// when its event is stored; kFull where too many wait for that.
//
// Events are records like others: shared by the policy `agent_event`, so that the leader has the whole team's event
// log. Where storage refuses one it is lost. A restart of this actor is one too; what was counted before it counts as
// logged.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "model/leases.h"
#include "proto/status.pb.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"

namespace moondb::proto {
class ControlReply;
class ControlRequest;
class ShareStatus;
}  // namespace moondb::proto

namespace moondb {

class EventActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Complete and checked.
    std::string version;     // Logged at the start.
    Duration period = std::chrono::minutes(1);
    Duration lost_after = std::chrono::minutes(1);         // Longer than a radio's flap; looked at each period.
    Duration lost_again_after = std::chrono::minutes(10);  // Between two events of one peer that is lost again.
  };

  explicit EventActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  struct Peer {
    bool is_connected = false;
    bool is_reported = false;                       // Its loss is in the event log, and its return is not.
    bool is_back_reported = false;                  // Its return is in the event log.
    MonotonicTime lost_at;                          // When the connection was lost, while there is none.
    std::int64_t lost_utc_ns = 0;                   // The same moment, UTC.
    std::optional<MonotonicTime> last_reported_at;  // When its loss was written down last.
  };

  // Actors that asked for the findings before they were known.
  struct Requester {
    Address from;
    std::uint64_t request_id = 0;
    std::optional<std::int64_t> acknowledges_until_ns;  // Without it, the asker wants to know the findings.
  };

  // An acknowledgment whose event is on its way into the store.
  struct Acknowledgment {
    Address from;
    std::uint64_t request_id = 0;
    std::uint32_t count = 0;
    MonotonicTime asked_at;
  };

  void OnRoles(Context& context, const proto::RoleAssignment& roles);
  void OnPeriod(Context& context);
  void OnStorageStatus(Context& context, const proto::StorageStatus& status);
  void OnShareStatus(Context& context, const std::string& actor, const proto::ShareStatus& status);

  void OnPeerEvent(Context& context, const proto::PeerEvent& event);
  void LogLostPeers(Context& context);
  void LogReturnedPeers(Context& context);
  void LogReturn(Context& context, AgentId agent, Peer& peer, std::int64_t lost_utc_ns);
  void OnFindings(Context& context, const proto::AgentStatus& status);
  void OnInserted(Context& context, std::uint64_t request_id, const proto::InsertReply& inserted);

  void OnControlRequest(Context& context, const proto::Message& message);
  void OnControlReply(Context& context, const proto::Message& message);
  // An actor that asks for the findings, or acknowledges those up to a stamp.
  void OnRequester(Context& context, std::uint64_t request_id, std::optional<std::int64_t> until_ns);
  void AskFindings(Context& context);
  void AnswerRequester(Context& context, const Requester& requester);
  void Acknowledge(Context& context, const Requester& requester);
  static void Reply(Context& context, const Address& to, std::uint64_t request_id, const proto::ControlReply& reply);

  void Ask(Context& context, const std::string& actor, const proto::ControlRequest& request) const;
  void Log(Context& context, proto::EventKind kind, const std::string& text);
  // `timestamp_ns` says when it happened, which for a finding may be a while ago.
  void LogAt(Context& context, proto::EventKind kind, const std::string& text, std::int64_t timestamp_ns);
  // `counter` names a number that only rises; logged is by how much it rose: "3 TEXT". What `source` said first was
  // before this actor's life.
  void LogRise(Context& context, proto::EventKind kind, const std::string& source, const std::string& counter,
               double count, const std::string& text);

  const Options options_;
  std::map<std::pair<std::string, std::string>, double> counts_;  // By source and counter.
  std::set<std::string> heard_;                                   // Sources.
  proto::RoleAssignment roles_;
  Leases leases_;
  std::map<AgentId, Peer> peers_;  // Agents that were connected since this actor started.

  std::vector<proto::HealthFinding> findings_;  // As StorageActor said last.
  std::uint64_t findings_version_ = 1;          // Rises with each event that changes them.
  std::uint64_t known_version_ = 0;             // The version of findings_ that is known.
  std::uint64_t asked_version_ = 0;
  std::uint64_t findings_request_id_ = 0;  // The id of the last question to storage.
  std::vector<Requester> requesters_;
  std::map<std::uint64_t, Acknowledgment> acknowledgments_;  // By request id.
  std::uint64_t next_request_id_ = 0;
};

}  // namespace moondb
