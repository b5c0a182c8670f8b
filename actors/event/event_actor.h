// EventActor ("event"): writes this agent's event log, as records of the type `agent_event`.
//
// Logs the start of the agent, each role assignment that this agent issued, and the loss and return of peers. Once a
// minute it logs new failures: actor restarts, refused or damaged records and messages, and sharing sessions that ended
// early. Failures of one kind become one event with a count. GatewayActor logs commands.
//
// A peer counts as lost if its connection has been down for `lost_after` while no silence was expected. Silence is
// expected while the peer or this agent sleeps, or drives in a team with radio silence while driving.
//
// Answers the ControlRequest `status` with the findings (model/event.h): losses and damage that no operator has
// acknowledged. StorageActor computes the findings from the stored events (actors/storage/findings.h). Answers an
// AcknowledgeRequest after the acknowledging event is stored, or with kFull if too many acknowledgments wait.
//
// An event that storage refuses is lost. After a restart, this actor does not log failures from before the restart.
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
    proto::TeamConfig team;  // Requires: complete and validated.
    std::string version;     // Logged when the agent starts.
    Duration period = std::chrono::minutes(1);
    // A disconnected peer counts as lost after this time, which is longer than a short radio dropout. Checked once per
    // `period`.
    Duration lost_after = std::chrono::minutes(1);
    // Minimum time between two loss events of one peer.
    Duration lost_again_after = std::chrono::minutes(10);
  };

  explicit EventActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  struct Peer {
    bool is_connected = false;
    bool is_reported = false;                       // The peer's loss is logged, but not its return.
    bool is_back_reported = false;                  // The peer's return is logged.
    MonotonicTime lost_at;                          // Time of the last disconnect; valid while disconnected.
    std::int64_t lost_utc_ns = 0;                   // UTC time of the last disconnect.
    std::optional<MonotonicTime> last_reported_at;  // Time of the last loss event.
  };

  // A request for the findings, or for their acknowledgment, that waits until the findings are up to date.
  struct Requester {
    Address from;
    std::uint64_t request_id = 0;
    std::optional<std::int64_t> acknowledges_until_ns;  // Null if the requester only reads the findings.
  };

  // An acknowledgment whose event was sent to storage and is not stored yet.
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
  // Other actors log events too, and StorageActor logs findings. The next requester gets them.
  void OnRecordsStored(const proto::RecordsStored& stored);
  // Handles a request of the message's sender. `until_ns`: null to report the findings; otherwise all findings with
  // timestamps up to this time are acknowledged.
  void OnRequester(Context& context, std::uint64_t request_id, std::optional<std::int64_t> until_ns);
  void RequestFindings(Context& context);
  void AnswerRequester(Context& context, const Requester& requester);
  void Acknowledge(Context& context, const Requester& requester);
  static void Reply(Context& context, const Address& to, std::uint64_t request_id, const proto::ControlReply& reply);

  void Ask(Context& context, const std::string& actor, const proto::ControlRequest& request) const;
  void Log(Context& context, proto::EventKind kind, const std::string& text);
  // `timestamp_ns`: time of the event. It may lie in the past.
  void LogAt(Context& context, proto::EventKind kind, const std::string& text, std::int64_t timestamp_ns);
  // Logs by how much `counter` rose since the last call, as "3 TEXT". Logs nothing if `counter` rose by less than 1, or
  // in the first report of `source`, which includes failures from before this actor started. A counter falls only when
  // its actor restarts.
  void LogRise(Context& context, proto::EventKind kind, const std::string& source, const std::string& counter,
               double count, const std::string& text);

  const Options options_;
  std::map<std::pair<std::string, std::string>, double> counts_;  // Last value of each counter, by source and name.
  std::set<std::string> heard_;                                   // Sources that have reported at least once.
  std::map<std::string, std::set<AgentId>> refusing_;  // Agents that do not take all records, by sharing actor.
  proto::RoleAssignment roles_;
  Leases leases_;
  std::map<AgentId, Peer> peers_;  // Agents that have been connected since this actor started.

  std::vector<proto::HealthFinding> findings_;  // The last findings from StorageActor.
  std::uint64_t findings_version_ = 1;          // Rises with each event that changes the findings.
  std::uint64_t known_version_ = 0;             // The version that `findings_` reflects.
  bool is_event_stored_ = false;                // True if any actor's event was stored after the last request.
  std::uint64_t asked_version_ = 0;
  std::uint64_t findings_request_id_ = 0;  // Id of the last FindingsRequest.
  std::vector<Requester> requesters_;
  std::map<std::uint64_t, Acknowledgment> acknowledgments_;  // Keyed by the id of the InsertRequest.
  std::uint64_t next_request_id_ = 0;
};

}  // namespace moondb
