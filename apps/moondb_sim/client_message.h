// Builds and parses the messages of simulated clients and of RetentionActors.
#pragma once

#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "runtime/actor.h"

namespace moondb::simulation {

// Returns the message with which a client on the agent's own machine sends `request`. A local client may send
// every command.
proto::Message ClientMessage(std::uint64_t request_id, const proto::ControlRequest& request);
// Returns the answer to a client that `message` holds; null for other messages.
std::optional<proto::ControlReply> ClientReplyIn(const proto::Message& message);

// Returns the longest time that a gateway may take to answer `request`. The gateway's timeouts are `timeout` and
// `long_timeout`.
Duration AnsweredWithin(const proto::ControlRequest& request, Duration timeout, Duration long_timeout);
// Returns a readable name of the request, such as "downlink for agent 4".
std::string NameOf(const proto::ControlRequest& request);

// Returns the have-set if `message` is the answer of one RetentionActor to another; null for other messages.
std::optional<HaveSet> HaveInAnswer(const proto::Message& message);

}  // namespace moondb::simulation
