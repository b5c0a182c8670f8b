// SystemStatus: the runtime's own data about an agent's actors and its links to peers. A separate header, because a new
// field would otherwise recompile every user of actor.h.
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
