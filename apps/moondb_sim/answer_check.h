// Checks invariant answer_true: an agent's successful answer to a client agrees with the agent's state at the instant
// of the answer.
//
// Other checkers cover lasting effects: invariants.h covers inserts, map_checker.h maps, and bundle_checker.h bundles.
#pragma once

#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/control.pb.h"

namespace moondb::simulation {

// The state of an agent at the instant at which it received and answered a request.
struct AgentFacts {
  AgentId self = 0;
  HaveSet before;               // Have-set before the agent handled the request.
  HaveSet after;                // Have-set after the agent answered.
  proto::RoleAssignment roles;  // Role assignment that the agent's actors last received.
  proto::Term durable_term;     // Term of the roles on the agent's disk.
};

// Returns why `reply`, a successful answer to `request`, is untrue. Null if the answer is true, or if requests of this
// kind are not checked.
std::optional<std::string> WhyUntrue(const proto::ControlRequest& request, const proto::ControlReply& reply,
                                     const AgentFacts& facts);

}  // namespace moondb::simulation
