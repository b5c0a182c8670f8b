// Decoders of bytes from peers and clients that also decide whom to trust (tests/fuzz/decoders.h). Each fails a Check
// if the bytes have a forbidden effect.
#pragma once

#include <string_view>

#include "proto/record.pb.h"

namespace moondb {

// Input: whether the connection's agent is known (1 byte), a frame of a peer.
void RunPeerFrame(std::string_view bytes);

// Input: a frame of a client. A request is also checked against the gateway's rules.
void RunClientFrame(std::string_view bytes);

// Input: a record. Only the two records below may have a valid signature.
void RunSigned(std::string_view bytes);

// Input: messages between RoleActors, each with sender, kind (1 byte each) and length (2 bytes). Messages that a rover
// without a past lead can sign must not change an agent's roles.
void RunChain(std::string_view bytes);

// Records signed by agent 1 of the fuzzed team.
proto::Record FuzzedAssignment();
proto::Record FuzzedQuarantine();

}  // namespace moondb
