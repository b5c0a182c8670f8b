// What reads bytes of peers and clients before and behind the door, and decides whom to believe
// (tests/fuzz/decoders.h). Each stops by Check where bytes move what they must not.
#pragma once

#include <string_view>

#include "proto/record.pb.h"

namespace moondb {

// Whether the connection's agent is known (1 byte), a frame of a peer.
void RunPeerFrame(std::string_view bytes);

// A frame of a client; with a request the rules of the gateway.
void RunClientFrame(std::string_view bytes);

// A record: no other than the two below has a signature of theirs.
void RunSigned(std::string_view bytes);

// Messages between RoleActors, each with who sends it (1 byte), its kind (1 byte) and its length (2 bytes): nothing
// that a rover that never led can sign moves an agent's roles.
void RunChain(std::string_view bytes);

// As agent 1 of the fuzzed team signed them.
proto::Record FuzzedAssignment();
proto::Record FuzzedQuarantine();

}  // namespace moondb
