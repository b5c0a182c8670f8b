// ClockActor ("clock"): lets the agents of a team compare their clocks, so that each can tell when its own is wrong
// (actors/storage/clock_judge.h).
//
// Reports to another agent what time it is here each time the link to it comes up, and all of them when this agent's
// clock has jumped; passes what they say on to StorageActor. Sends nothing else. What it says is right to within the
// time that a message travels.
#pragma once

#include <set>

#include "proto/team.pb.h"
#include "runtime/actor.h"

namespace moondb {

class ClockActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Complete and checked.
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
