// Decoders of untrusted bytes that also decide which senders and signatures to trust (tests/fuzz/decoders.h). Check
// fails if the bytes have a forbidden effect.
#pragma once

#include <string_view>

#include "proto/record.pb.h"

namespace moondb {

// Input: 1 byte that is odd if the connection's agent is known, then a frame of a peer.
void RunPeerFrame(std::string_view bytes);

// Input: a frame of a client. Also checks the request against the gateway's rules.
void RunClientFrame(std::string_view bytes);

// Input: a record. Check fails if a record other than FuzzedAssignment and FuzzedQuarantine has a valid signature.
void RunSigned(std::string_view bytes);

// Input: messages between RoleActors, each with sender (1 byte), kind (1 byte), length (2 bytes) and content. Only
// assignments of a rover that has never led count as signed. Check fails if a message changes the roles.
void RunChain(std::string_view bytes);

// Each returns a record with a valid signature of agent 1 of the fuzzed team.
proto::Record FuzzedAssignment();
proto::Record FuzzedQuarantine();

}  // namespace moondb
