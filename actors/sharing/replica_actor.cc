#include "actors/sharing/replica_actor.h"

namespace moondb {

Result<int> ReplicaActor::Share(Context& context, const proto::ShareRequest& request) {
  if (!request.from_agents().empty()) {
    return Fail(ErrorCode::kInvalid, "is for sync; replication goes from the leader to the survivor", "from_agents");
  }
  if (request.destination() == self()) return Fail(ErrorCode::kInvalid, "is this agent itself", "destination");
  if (request.destination() != 0) {
    Open(context, request.destination(), proto::RecordFilter(), /*is_by_role=*/false);
    return 1;
  }
  if (!is_leading()) {
    const std::string leader = roles().leader() == 0 ? "nobody" : NameOf(roles().leader());
    return Fail(ErrorCode::kRefused, NameOf(self()) + " does not lead, " + leader + " does: give the command there");
  }
  if (roles().survivor() == 0) return Fail(ErrorCode::kRefused, "no designated survivor is assigned");
  Open(context, roles().survivor(), proto::RecordFilter(), /*is_by_role=*/true);
  return 1;
}

void ReplicaActor::OnNewRoles(Context& context, const proto::RoleAssignment& previous) {
  if (roles().leader() == previous.leader() && roles().survivor() == previous.survivor()) return;
  const bool was_open = CloseByRole(context);
  if (is_leading()) {
    if (was_open && roles().survivor() != 0) {
      Open(context, roles().survivor(), proto::RecordFilter(), /*is_by_role=*/true);
    }
  } else if ((was_open || previous.leader() == self()) && roles().leader() != 0) {
    Open(context, roles().leader(), proto::RecordFilter(), /*is_by_role=*/true);
  }
}

}  // namespace moondb
