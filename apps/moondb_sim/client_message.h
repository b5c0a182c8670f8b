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

// Returns the message of a client on the agent's own machine, which may send every command.
proto::Message ClientMessage(std::uint64_t request_id, const proto::ControlRequest& request);
// Returns the answer to a client; null for other messages.
std::optional<proto::ControlReply> ClientReplyIn(const proto::Message& message);

// Returns the longest time that a gateway with these timeouts may take to answer.
Duration AnsweredWithin(const proto::ControlRequest& request, Duration timeout, Duration long_timeout);
// Returns a name for people, such as "downlink for agent 4".
std::string NameOf(const proto::ControlRequest& request);

// Returns the have-set in a RetentionActor's answer to another RetentionActor; null for other messages.
std::optional<HaveSet> HaveInAnswer(const proto::Message& message);

}  // namespace moondb::simulation
