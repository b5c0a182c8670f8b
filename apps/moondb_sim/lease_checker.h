// LeaseChecker: who drives, sleeps and is paused as one agent has been told, and what its sharing actors may not send
// meanwhile: the rule quiet_window. It listens to what the agent's LeaseActor is told, not to what that one makes of
// it.
//
// Of one life of the agent. All that happens within one instant of virtual time may happen in any order, so what was
// told counts from the next instant on. An actor that was made anew has to ask what stands: until it is told, it knows
// nothing.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "proto/message.pb.h"
#include "runtime/actor.h"

namespace moondb::simulation {

class LeaseChecker {
 public:
  explicit LeaseChecker(AgentId self = 0) : self_(self) {}

  // An actor of the agent handles the message.
  void OnHandle(const std::string& actor, const proto::Message& message, MonotonicTime now);
  // It fails at it, and is made anew.
  void OnFailure(const std::string& actor);

  // What is wrong with it if an actor of the agent sends this to another agent.
  std::optional<std::string> WhyQuiet(const std::string& actor, AgentId to, const proto::Message& message,
                                      MonotonicTime now) const;
  // The last time up to now when `agent` drove or slept, and so might be silent, as far as this one was told;
  // MonotonicTime::min(): never.
  MonotonicTime LastQuiet(AgentId agent, MonotonicTime now) const;

 private:
  struct Lease {
    std::optional<std::uint64_t> number;  // Of the announcement that counts.
    MonotonicTime reported;
    MonotonicTime driving_until = MonotonicTime::min();
    MonotonicTime sleeping_until = MonotonicTime::min();
    MonotonicTime paused_until = MonotonicTime::min();
    MonotonicTime ended = MonotonicTime::min();  // The last one that another took the place of.
  };

  // When what the request is about ends.
  static MonotonicTime& UntilOf(Lease& lease, proto::LeaseKind kind);
  void OnRequest(const proto::LeaseRequest& request, MonotonicTime now);
  void OnAnnounce(AgentId from, const proto::LeaseAnnounce& announce, MonotonicTime now);

  AgentId self_;
  std::map<AgentId, Lease> leases_;
  std::map<std::string, MonotonicTime> knows_since_;  // Of actors that were told what stands.
};

}  // namespace moondb::simulation
