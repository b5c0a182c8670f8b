// LeaseChecker: tracks which agents drive, sleep or are paused, as far as one agent knows, and checks that the sharing
// actors of this agent respect these leases (invariant quiet_window). It uses only the messages that the agent's actors
// handle.
//
// A checker covers one process lifetime of the agent. A lease takes effect at the instant after its message, because
// events within one instant of virtual time may happen in any order. A restarted actor knows no leases until it
// receives them again.
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

  // Call when the agent's actor named `actor` handles `message`.
  void OnHandle(const std::string& actor, const proto::Message& message, MonotonicTime now);
  // Call when the agent's actor named `actor` fails and restarts.
  void OnFailure(const std::string& actor);

  // Returns a description of the lease that forbids `actor` to send `message` to agent `to` at `now`; null if there is
  // none.
  std::optional<std::string> WhyQuiet(const std::string& actor, AgentId to, const proto::Message& message,
                                      MonotonicTime now) const;
  // Returns the last time, not later than `now`, at which `agent` drove or slept, as far as the checked agent knows.
  // Returns MonotonicTime::min() if there is none.
  MonotonicTime LastQuiet(AgentId agent, MonotonicTime now) const;

 private:
  struct Lease {
    std::optional<std::uint64_t> number;  // Number of the newest announcement.
    MonotonicTime reported;
    MonotonicTime driving_until = MonotonicTime::min();
    MonotonicTime sleeping_until = MonotonicTime::min();
    MonotonicTime paused_until = MonotonicTime::min();
    MonotonicTime ended = MonotonicTime::min();  // When the previous lease ended.
  };

  // Returns the member of `lease` with the end time of a lease of `kind`.
  static MonotonicTime& UntilOf(Lease& lease, proto::LeaseKind kind);
  void OnRequest(const proto::LeaseRequest& request, MonotonicTime now);
  void OnAnnounce(AgentId from, const proto::LeaseAnnounce& announce, MonotonicTime now);

  AgentId self_;
  std::map<AgentId, Lease> leases_;
  std::map<std::string, MonotonicTime> knows_since_;  // When each actor first received leases since its restart.
};

}  // namespace moondb::simulation
