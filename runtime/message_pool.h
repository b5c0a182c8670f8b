// Where messages within an agent lie: each in one block of memory, together with its reference count.
//
// Blocks are used again: one thread's actors make messages that another's let go, which malloc answers with a lock on
// each (measured: half of the throughput of two threads). Here whole chains of blocks change hands under one lock. What
// a message's body points to comes from malloc as ever.
#pragma once

#include "runtime/actor.h"

namespace moondb {

// Any thread; so may the last owner let it go on any.
MessagePtr MakeMessage(proto::Message&& message);

}  // namespace moondb
