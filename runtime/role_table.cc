#include "runtime/role_table.h"

#include "proto/term.pb.h"

namespace moondb {

void RoleTable::SetRoles(const proto::RoleAssignment& roles) {
  leader_and_survivor_ = std::uint64_t{roles.leader()} << 32 | roles.survivor();
}

AgentId RoleTable::Resolve(AgentId agent) const {
  switch (agent) {
    case kLeaderAlias:
      return static_cast<AgentId>(leader_and_survivor_ >> 32);
    case kSurvivorAlias:
      return static_cast<AgentId>(leader_and_survivor_ & 0xFFFF'FFFF);
    case kBaseAlias:
      return base_station_;
    default:
      return agent;
  }
}

}  // namespace moondb
