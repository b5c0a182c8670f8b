// FailoverChecker: checks that one agent takes the lead without an operator only with a cause (invariant
// failover_has_cause), and that it does so in time (failover_happens). It uses only the messages that the agent's
// actors handle, and covers one process lifetime of the agent.
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

  // Call when an actor of the agent handles `message`. Returns a description if `message` is the agent's own request to
  // lead and the agent had no cause to send it; null otherwise.
  std::optional<std::string> OnHandle(const std::string& actor, const proto::Message& message,
                                      const LeaseChecker& leases, MonotonicTime now);
  // Call when the agent's actor named `actor` fails and restarts.
  void OnFailure(const std::string& actor, MonotonicTime now);

  // Returns a description of the failure if the agent should have taken the lead before `now`; null otherwise.
  std::optional<std::string> WhyOverdue(const LeaseChecker& leases, MonotonicTime now) const;

  // Returns whether `message` to `actor` is a survivor's request to its own RoleActor to lead.
  static bool IsFailover(const std::string& actor, const proto::Message& message);

 private:
  // Returns why the agent may not take the lead at `now`; null if it may. To take the lead, the agent must have had no
  // connection to the leader for at least the time `missed`.
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
  // Time at which each agent's connection was lost. Has only agents that are not connected now.
  std::map<AgentId, MonotonicTime> lost_;
  // Time at which an actor of this agent last handled a message from each other agent.
  std::map<AgentId, MonotonicTime> heard_;
  MonotonicTime reached_since_;         // When `connected_` last became non-empty. Invalid while it is empty.
  MonotonicTime asked_;                 // When the agent last requested to lead.
  std::optional<std::string> verdict_;  // Result of WhyNot at the last timer of FailoverActor.
};

}  // namespace moondb::simulation
