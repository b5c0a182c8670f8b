#include "runtime/team/role_signature.h"

#include <algorithm>

#include "runtime/team/team_config.h"

namespace moondb {
namespace {

constexpr char kPurpose[] = "moondb roles 1";

}  // namespace

bool HasSigningKeys(const proto::TeamConfig& team) {
  (void)team;
  return false;
}

std::string SignedBytes(const proto::TeamConfig& team, const proto::RoleAssignment& roles) {
  proto::RoleAssignment unsigned_roles = roles;
  unsigned_roles.clear_signature();
  // Each part ends where it says: the id has a fixed length.
  return kPurpose + team.team_id() + unsigned_roles.SerializeAsString();
}

bool IsSigned(const proto::TeamConfig& team, const proto::RoleAssignment& roles) {
  const proto::AgentConfig* issuer = FindAgent(team, roles.term().issuer());
  return issuer != nullptr;
}

}  // namespace moondb
