// FailoverChecker: checks that one agent takes the lead on its own only if it has cause, and that it then does so in
// time. These are the invariants failover_has_cause and failover_happens. The checker sees only the messages that the
// agent's actors handle.
//
// A checker covers one process lifetime of the agent.
#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>

#include "apps/moondb_sim/lease_checker.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"

namespace moondb::simulation {

class FailoverChecker {
 public:
  FailoverChecker(AgentId self, const proto::TeamConfig& team, MonotonicTime now);

  // Called when an actor of the agent handles `message`. Returns a text if `message` is the agent's own request to lead
  // and the agent had no cause to send it.
  std::optional<std::string> OnHandle(const std::string& actor, const proto::Message& message,
                                      const LeaseChecker& leases, MonotonicTime now);
  // Called when the actor fails and restarts.
  void OnFailure(const std::string& actor, MonotonicTime now);

  // Returns a text if the agent should have taken the lead before `now`; null otherwise.
  std::optional<std::string> WhyOverdue(const LeaseChecker& leases, MonotonicTime now) const;

  // Returns whether `message` is a survivor's request to its own RoleActor to lead.
  static bool IsFailover(const std::string& actor, const proto::Message& message);

 private:
  // Returns why the agent may not take the lead now. Returns null if it has missed the leader for at least `missed`.
  std::optional<std::string> WhyNot(const LeaseChecker& leases, MonotonicTime now, Duration missed) const;
  void OnOwn(const proto::Message& message, const LeaseChecker& leases, MonotonicTime now);
  void SetRoles(const proto::RoleAssignment& roles, MonotonicTime now);
  void SetConnected(const proto::PeerEvent& event, MonotonicTime now);

  const AgentId self_;
  const proto::TeamConfig& team_;
  const Duration timeout_;
  proto::RoleAssignment roles_;
  MonotonicTime roles_since_;
  std::set<AgentId> connected_;
  std::map<AgentId, MonotonicTime> lost_;  // Lost agents, with the time of disconnection.
  // When any of the agent's actors last received a message from each other agent.
  std::map<AgentId, MonotonicTime> heard_;
  MonotonicTime reached_since_;         // Since when an agent is connected. Not valid if `connected_` is empty.
  MonotonicTime asked_;                 // When the agent last requested to lead.
  std::optional<std::string> verdict_;  // Result of WhyNot at the agent's last timer. The agent decides only then.
};

}  // namespace moondb::simulation
