// SystemStatus: what the runtime itself knows of an agent's actors and of the ways to its peers. Apart from actor.h, so
// that a new field of a status does not make every actor be built anew.
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
