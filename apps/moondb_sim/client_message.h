// Messages between simulated clients and their agents' gateways, and among gateways, storage and retention. The
// simulator builds and parses them only here. Free functions.
#pragma once

#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "runtime/actor.h"

namespace moondb::simulation {

// Returns the message with which a client on the agent's own machine sends `request`. Such a client may send every
// command.
proto::Message ClientMessage(std::uint64_t request_id, const proto::ControlRequest& request);
// Returns the answer to a client that `message` holds; null for other messages.
std::optional<proto::ControlReply> ClientReplyIn(const proto::Message& message);

// Returns the longest time that a gateway may take to answer `request`. The gateway's timeouts are `timeout` and
// `long_timeout`.
Duration AnsweredWithin(const proto::ControlRequest& request, Duration timeout, Duration long_timeout);
// Returns a readable name of the request, such as "downlink for agent 4".
std::string NameOf(const proto::ControlRequest& request);

// Returns the have-set that one RetentionActor sends to another in an answer; null for other messages.
std::optional<HaveSet> HaveInAnswer(const proto::Message& message);

}  // namespace moondb::simulation
