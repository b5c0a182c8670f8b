// What a plain state machine of this folder wants done; the actor around it does it.
#pragma once

#include <vector>

#include "model/ids.h"
#include "proto/message.pb.h"

namespace moondb {

struct SharingAction {
  AgentId to = 0;  // The peer whose actor of the same name is meant; 0: this agent's StorageActor.
  proto::Message message;
};

using SharingActions = std::vector<SharingAction>;

}  // namespace moondb
