// SharingAction: a message that a state machine of this folder returns. The actor that owns the state machine sends the
// message.
#pragma once

#include <vector>

#include "model/ids.h"
#include "proto/message.pb.h"

namespace moondb {

struct SharingAction {
  AgentId to = 0;  // Peer whose actor of the same name gets the message; 0: this agent's StorageActor gets it.
  proto::Message message;
};

using SharingActions = std::vector<SharingAction>;

}  // namespace moondb
