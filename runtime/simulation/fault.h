// Faults that SimulatedTeam::SetFault can inject when an actor handles a message.
#pragma once

namespace moondb::simulation {

// After a fault, the actor restarts as after Context::Fail.
enum class Fault {
  kNone,
  kBeforeHandler,   // The actor fails instead of handling the message.
  kAtFirstSend,     // Throws in the first Send or Publish, which sends nothing. If there is none: as kAfterHandler.
  kAfterFirstSend,  // Throws after the first Send or Publish. If there is none: as kAfterHandler.
  kAfterHandler,    // The actor fails after the handler has completed and sent everything.
};

}  // namespace moondb::simulation
