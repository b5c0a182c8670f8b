// SystemStatus: the runtime's own data about an agent's actors and its links to peers. Kept out of actor.h, because a
// new field in a status would otherwise recompile every actor.
#pragma once

#include <vector>

#include "proto/status.pb.h"
#include "runtime/actor.h"

namespace moondb {

struct SystemStatus {
  std::vector<proto::PeerStatus> peers;
  std::vector<proto::ActorStatus> actors;
  Duration uptime{};
};

}  // namespace moondb
