// Fault that SimulatedTeam::SetFault injects when an actor is about to handle a message.
#pragma once

namespace moondb::simulation {

// Kinds of faults. After a fault, the actor restarts as after Context::Fail.
enum class Fault {
  kNone,
  kBeforeHandler,   // The actor fails instead of handling the message.
  kAtFirstSend,     // The first Send or Publish throws and sends nothing. If there is no send: as kAfterHandler.
  kAfterFirstSend,  // The first Send or Publish sends and then throws. If there is no send: as kAfterHandler.
  kAfterHandler,    // The actor fails after the handler has completed and sent everything.
};

}  // namespace moondb::simulation
