// FailoverChecker: whether one agent has cause to take the lead by itself, as one who sees what its actors handle knows
// it: the rules failover_has_cause and failover_happens.
//
// Of one life of the agent.
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

  // An actor of the agent handles the message. What is wrong, if it is its request to lead that is handled, and it had
  // no cause for it.
  std::optional<std::string> OnHandle(const std::string& actor, const proto::Message& message,
                                      const LeaseChecker& leases, MonotonicTime now);
  // It fails at it, and is made anew.
  void OnFailure(const std::string& actor, MonotonicTime now);

  // What is wrong: it should have taken the lead before now.
  std::optional<std::string> WhyOverdue(const LeaseChecker& leases, MonotonicTime now) const;

  // A survivor asks its own RoleActor for the lead.
  static bool IsFailover(const std::string& actor, const proto::Message& message);

 private:
  // Why it may not take the lead now; nothing if it has had cause for `missed`.
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
  std::map<AgentId, MonotonicTime> lost_;   // Since when agents are away that were connected once.
  std::map<AgentId, MonotonicTime> heard_;  // By any actor.
  MonotonicTime reached_since_;             // Somebody; where nobody is connected, no time yet.
  MonotonicTime asked_;                     // To lead, last.
  std::optional<std::string> verdict_;      // At its last timer, at which alone it decides.
};

}  // namespace moondb::simulation
