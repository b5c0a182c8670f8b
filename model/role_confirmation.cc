#include "model/role_confirmation.h"

#include <algorithm>

#include "model/ids.h"

namespace moondb {

void AddNotConfirmed(proto::RoleShowReply& shown) {
  const proto::RoleAssignment& roles = shown.roles();
  const auto is_confirmed = [&shown](AgentId agent) {
    const auto& confirmed = shown.confirmed_by();
    return std::find(confirmed.begin(), confirmed.end(), agent) != confirmed.end();
  };
  if (roles.term().issuer() != roles.leader() || !is_confirmed(roles.leader())) {
    shown.add_not_confirmed_by(roles.leader());
  }
  if (roles.survivor() != 0 && !is_confirmed(roles.survivor())) shown.add_not_confirmed_by(roles.survivor());
}

}  // namespace moondb
