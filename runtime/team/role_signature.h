// Signatures of role assignments: each by its issuer's signing key, the public half of which stands in the team file.
#pragma once

#include <string>

#include "model/role_chain.h"
#include "proto/team.pb.h"
#include "proto/term.pb.h"

namespace moondb {

// Whether the team signs: every agent has a signing key. An `insecure` team has none.
bool HasSigningKeys(const proto::TeamConfig& team);

// What is signed: what it is for, whose team it is, and all that the assignment says but for the signature.
std::string SignedBytes(const proto::TeamConfig& team, const proto::RoleAssignment& roles);

// By its issuer's key in the team file; false too where the issuer is not of the team or has no key.
bool IsSigned(const proto::TeamConfig& team, const proto::RoleAssignment& roles);

// What a RoleChain of this team needs.
RoleChain::Options RoleChainOptions(const proto::TeamConfig& team);

}  // namespace moondb
