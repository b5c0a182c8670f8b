// SharingAction: a message that a state machine of this folder returns. The actor that owns the state machine sends it.
#pragma once

#include <vector>

#include "model/ids.h"
#include "proto/message.pb.h"

namespace moondb {

struct SharingAction {
  AgentId to = 0;  // Sent to this peer's actor of the same name; 0: to this agent's StorageActor.
  proto::Message message;
};

using SharingActions = std::vector<SharingAction>;

}  // namespace moondb
