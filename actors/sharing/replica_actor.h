// ReplicaActor: brings all records that the leader holds to the designated survivor (paper, Section 4).
//
// Nothing is left out but what the survivor's have-set shows: so a lost disk, the survivor's own too, is filled again.
// A ShareRequest{REPLICATION} is the leader's to carry out; with `destination` set any agent replicates to there.
// When the roles change, an unfinished replication turns to the new survivor, and a deposed leader replicates all it
// holds to the new leader once, so that what it alone had collected is not lost with it; if that one is deposed too
// before it has all, its successor gets it.
#pragma once

#include "actors/sharing/sharing_actor.h"

namespace moondb {

class ReplicaActor final : public SharingActor {
 public:
  explicit ReplicaActor(Options options) : SharingActor(std::move(options), proto::SHARING_KIND_REPLICATION) {}

 private:
  Result<int> Share(Context& context, const proto::ShareRequest& request) override;
  void OnNewRoles(Context& context, const proto::RoleAssignment& previous) override;
};

}  // namespace moondb
