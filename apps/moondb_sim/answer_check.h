// Whether what an agent answered a client with success is so, as far as one instant shows it: the rule answer_true.
//
// Pure functions. Other watches look at what lasts: rules.h at inserts, map_checker.h at maps, bundle_checker.h at
// bundles.
#pragma once

#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/control.pb.h"

namespace moondb::simulation {

// What is known of an agent at the instant at which it was asked and answered.
struct AgentFacts {
  AgentId self = 0;
  HaveSet before;               // What it had before it was asked,
  HaveSet after;                // and when it had answered.
  proto::RoleAssignment roles;  // That its actors received last.
  proto::Term durable_term;     // On its disk.
};

// What is wrong with an answer that is no error; nothing if nothing is, or nothing is known of that request.
std::optional<std::string> WhyUntrue(const proto::ControlRequest& request, const proto::ControlReply& reply,
                                     const AgentFacts& facts);

}  // namespace moondb::simulation
