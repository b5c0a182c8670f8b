// LeaseChecker: tracks which agents drive, sleep or are paused, as far as one agent knows, and checks the messages that
// its sharing actors send meanwhile (invariant quiet_window). It reads the messages to the agent's LeaseActor, and does
// not rely on that actor's conclusions.
//
// A checker covers one process lifetime of the agent. Events within one instant of virtual time may happen in any
// order, so a message takes effect at the next instant. A restarted actor knows no leases until it receives them again.
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

  // Called when an actor of the agent handles `message`.
  void OnHandle(const std::string& actor, const proto::Message& message, MonotonicTime now);
  // Called when the actor fails and restarts.
  void OnFailure(const std::string& actor);

  // Returns a text if an actor of the agent may not send `message` to `to` now.
  std::optional<std::string> WhyQuiet(const std::string& actor, AgentId to, const proto::Message& message,
                                      MonotonicTime now) const;
  // Returns the last time, not later than `now`, at which `agent` drove or slept, as far as the checked agent knows.
  // `agent` could be silent then. MonotonicTime::min() means never.
  MonotonicTime LastQuiet(AgentId agent, MonotonicTime now) const;

 private:
  struct Lease {
    std::optional<std::uint64_t> number;  // Number of the newest announcement.
    MonotonicTime reported;
    MonotonicTime driving_until = MonotonicTime::min();
    MonotonicTime sleeping_until = MonotonicTime::min();
    MonotonicTime paused_until = MonotonicTime::min();
    MonotonicTime ended = MonotonicTime::min();  // End of the previous lease.
  };

  // Returns the time at which the lease of that kind ends.
  static MonotonicTime& UntilOf(Lease& lease, proto::LeaseKind kind);
  void OnRequest(const proto::LeaseRequest& request, MonotonicTime now);
  void OnAnnounce(AgentId from, const proto::LeaseAnnounce& announce, MonotonicTime now);

  AgentId self_;
  std::map<AgentId, Lease> leases_;
  std::map<std::string, MonotonicTime> knows_since_;  // When each actor first received leases since its restart.
};

}  // namespace moondb::simulation
