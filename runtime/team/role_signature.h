// Signatures of role assignments, made with the signing key of the issuer. The team file contains the public keys.
#pragma once

#include <string>

#include "model/role_chain.h"
#include "proto/team.pb.h"
#include "proto/term.pb.h"

namespace moondb {

// Returns true if every agent has a signing key and the team is not `insecure`. Role assignments of such a team are
// signed.
bool HasSigningKeys(const proto::TeamConfig& team);

// Returns the bytes to sign: a constant text for this purpose, the team id, and the assignment without its signature.
std::string SignedBytes(const proto::TeamConfig& team, const proto::RoleAssignment& roles);

// Returns true if the assignment's signature matches the issuer's key in the team file. Returns false if the issuer is
// not in the team or has no key.
bool IsSigned(const proto::TeamConfig& team, const proto::RoleAssignment& roles);

// Returns the options of a RoleChain for this team.
RoleChain::Options RoleChainOptions(const proto::TeamConfig& team);

}  // namespace moondb
