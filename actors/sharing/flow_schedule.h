// FlowSchedule: when an agent sends each destination its new records without an order (radio.sync_period_s).
//
// A destination is due when it may lack records. It is then served at once, but at most once a period. After a session
// in which the destination did not take some records, for example because its disk is full, it is served again after
// kRefusedDelayMin at the earliest. This delay doubles each time, up to kRefusedDelayMax. In case an event was missed,
// all destinations are due once in kFullRound, or once a period if that is longer.
//
// A destination that is not ready, because it is not connected or its window is shut, stays due and needs no timer. A
// state machine: the caller passes the time. Not thread-safe.
#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include "model/ids.h"

namespace moondb {

class FlowSchedule {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;

  static constexpr Duration kRefusedDelayMin = std::chrono::seconds(10);
  static constexpr Duration kRefusedDelayMax = std::chrono::minutes(10);
  static constexpr Duration kFullRound = std::chrono::minutes(1);

  // `period` zero: no destination is ever due.
  explicit FlowSchedule(Duration period) : period_(period) {}

  bool is_on() const { return period_ > Duration::zero(); }
  // Replaces the destinations. All are due.
  void SetDestinations(const std::set<AgentId>& destinations, Time now);
  // Notes which destinations may lack records now.
  void Note(const std::function<bool(AgentId)>& may_lack);

  struct State {
    bool is_ready = false;  // Records can pass to the destination now.
    bool is_busy = false;   // An order is being carried out, which must not change.
    // True if the destination did not take some records of the last session; nullopt while the session is open.
    std::optional<bool> has_refused;
  };
  using StateOf = std::function<State(AgentId)>;
  // Returns the destinations to serve now.
  std::vector<AgentId> TakeDue(Time now, const StateOf& state_of);
  // When to call TakeDue again, even if nothing happens; nullopt if never.
  std::optional<Time> deadline(const StateOf& state_of) const;
  // Returns the destinations that are due, ready or not.
  std::vector<AgentId> FindDue() const;
  // Returns the destinations that did not take all records of their last session, as far as it was noted.
  std::vector<AgentId> FindRefusing() const;

 private:
  struct Destination {
    bool is_due = true;
    Time served{};           // When it was last served.
    Time next{};             // Earliest time to serve it again.
    int refusals = 0;        // Sessions in a row of which it did not take all records.
    bool is_counted = true;  // The outcome of the last session is part of `refusals`.
  };

  static void ObserveOutcome(Destination& destination, const State& state);

  const Duration period_;
  std::map<AgentId, Destination> destinations_;
  Time full_round_{};  // When all destinations are due again.
};

}  // namespace moondb
