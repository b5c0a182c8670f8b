// Decoders of bytes from peers and clients that also decide whom to trust (tests/fuzz/decoders.h). If the bytes have a
// forbidden effect, a Check fails.
#pragma once

#include <string_view>

#include "proto/record.pb.h"

namespace moondb {

// Input: 1 byte that is odd if the connection's agent is known, then a frame of a peer.
void RunPeerFrame(std::string_view bytes);

// Input: a frame of a client. The decoder also checks the request against the gateway's rules.
void RunClientFrame(std::string_view bytes);

// Input: a record. Only FuzzedAssignment and FuzzedQuarantine may have a valid signature.
void RunSigned(std::string_view bytes);

// Input: messages between RoleActors, each with sender (1 byte), kind (1 byte) and length (2 bytes). Messages that a
// rover which has never led can sign must not change an agent's roles.
void RunChain(std::string_view bytes);

// Return records with valid signatures of agent 1 of the fuzzed team.
proto::Record FuzzedAssignment();
proto::Record FuzzedQuarantine();

}  // namespace moondb
