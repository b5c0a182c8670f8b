// ClockActor ("clock"): exchanges clock readings between agents, so each agent can detect that its own clock is wrong
// (actors/storage/clock_judge.h).
//
// Sends a ClockReport to each agent that connects, and to all connected agents after this agent's clock has jumped.
// Forwards the reports of other agents to StorageActor. A report is accurate to within the transit time of one message.
#pragma once

#include <set>

#include "proto/team.pb.h"
#include "runtime/actor.h"

namespace moondb {

class ClockActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Requires: complete and validated.
  };

  explicit ClockActor(Options options) : options_(std::move(options)) {}

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  void OnPeerEvent(Context& context, const proto::PeerEvent& event);
  void Notify(Context& context, AgentId peer) const;

  const Options options_;
  std::set<AgentId> connected_;
};

}  // namespace moondb
