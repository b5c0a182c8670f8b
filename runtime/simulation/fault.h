// Fault that SimulatedTeam::SetFault injects when an actor is about to handle a message.
#pragma once

namespace moondb::simulation {

// The actor then restarts as after Fail.
enum class Fault {
  kNone,
  kBeforeHandler,   // The actor fails instead of handling the message.
  kAtFirstSend,     // The first Send or Publish throws and sends nothing (if there is none: as kAfterHandler).
  kAfterFirstSend,  // The first Send or Publish sends and then throws (if there is none: as kAfterHandler).
  kAfterHandler,    // The actor fails after the handler has completed and sent everything.
};

}  // namespace moondb::simulation
