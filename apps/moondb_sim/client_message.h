// The words between simulated clients and their agents' gateways, and among gateways, storage and retention: the one
// place where the simulator makes and reads what they say. Plain functions.
#pragma once

#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "runtime/actor.h"

namespace moondb::simulation {

// Of a client on the agent's own machine, which may ask for everything.
proto::Message ClientMessage(std::uint64_t request_id, const proto::ControlRequest& request);
// Nothing where the message is no answer to a client.
std::optional<proto::ControlReply> ClientReplyIn(const proto::Message& message);

// How long a gateway with these limits may take to answer, at most.
Duration AnsweredWithin(const proto::ControlRequest& request, Duration timeout, Duration long_timeout);
// "downlink for agent 4", for people.
std::string NameOf(const proto::ControlRequest& request);

// What a RetentionActor answers another one, which asked what its agent has.
std::optional<HaveSet> HaveInAnswer(const proto::Message& message);

}  // namespace moondb::simulation
