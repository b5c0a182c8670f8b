#include "runtime/team/role_signature.h"

#include <algorithm>

#include "model/command_from.h"
#include "model/team_member.h"
#include "proto/term.pb.h"
#include "runtime/team/signing_key.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

constexpr char kRolePurpose[] = "moondb roles 1";

}  // namespace

bool HasSigningKeys(const proto::TeamConfig& team) {
  return !team.insecure() && !team.agents().empty() &&
         std::all_of(team.agents().begin(), team.agents().end(),
                     [](const proto::AgentConfig& agent) { return !agent.signing_key().empty(); });
}

std::string SignedBytes(const proto::TeamConfig& team, const proto::RoleAssignment& roles) {
  proto::RoleAssignment unsigned_roles = roles;
  unsigned_roles.clear_signature();
  // The concatenation is unambiguous: purpose and id have fixed lengths.
  return kRolePurpose + team.team_id() + unsigned_roles.SerializeAsString();
}

bool IsSigned(const proto::TeamConfig& team, const proto::RoleAssignment& roles) {
  const proto::AgentConfig* issuer = FindAgent(team, roles.term().issuer());
  return issuer != nullptr && IsSignatureOf(issuer->signing_key(), SignedBytes(team, roles), roles.signature());
}

RoleChain::Options RoleChainOptions(const proto::TeamConfig& team) {
  return {.initial = InitialRoles(team),
          .may_command = [team](AgentId agent) { return MayCommand(team, agent); },
          .has_keys = HasSigningKeys(team)};
}

}  // namespace moondb
