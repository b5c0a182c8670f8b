// Where messages within an agent lie: each in one block of memory, together with its reference count.
//
// Blocks are used again: one thread's actors make messages that another's let go, which malloc answers with a lock on
// each (measured: half of the throughput of two threads). Here many blocks change hands under one lock. What a
// message's body points to comes from malloc as ever.
#pragma once

#include <memory>

#include "proto/message.pb.h"

namespace moondb {

// Any thread; so may the last owner let it go on any.
std::shared_ptr<proto::Message> MakeMessage(proto::Message&& message);
std::shared_ptr<proto::Message> MakeMessage();  // An empty one.

}  // namespace moondb
