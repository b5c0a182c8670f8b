#include "runtime/simulation/simulated_radio.h"

#include <algorithm>

namespace moondb::simulation {

SimulatedRadio::Flight SimulatedRadio::Transmit(AgentId from, AgentId to, std::size_t bytes, MonotonicTime now) {
  Flight flight;
  flight.departure = now;
  const auto cut = cuts_.find(LinkOf(from, to));
  if (cut != cuts_.end() && cut->second == Cut::kKnown) {
    flight.result = SendResult::kUnreachable;
    return flight;
  }
  if (options_.bytes_per_second > 0) {
    MonotonicTime& empty_at = outbox_empty_at_[from];
    empty_at = std::max(empty_at, now);
    const double waiting = std::chrono::duration<double>(empty_at - now).count() * options_.bytes_per_second;
    if (waiting > 0 && waiting + static_cast<double>(bytes) > static_cast<double>(options_.outbox_bytes_max)) {
      flight.result = SendResult::kFull;
      return flight;
    }
    const std::chrono::duration<double> air_time(static_cast<double>(bytes) / options_.bytes_per_second);
    empty_at += std::chrono::duration_cast<Duration>(air_time);
    flight.departure = empty_at;
  }
  bytes_ += bytes;
  if (cut != cuts_.end() || DrawRatio() < options_.loss_ratio) return flight;
  flight.arrivals.push_back(flight.departure + DrawLatency());
  if (DrawRatio() < options_.duplicate_ratio) {
    flight.arrivals.push_back(flight.arrivals.front() + DrawDuration(options_.duplicate_delay_max));
  }
  return flight;
}

void SimulatedRadio::SetLink(AgentId a, AgentId b, bool is_up, bool is_known) {
  if (is_up) {
    cuts_.erase(LinkOf(a, b));
  } else {
    cuts_[LinkOf(a, b)] = is_known ? Cut::kKnown : Cut::kUnknown;
  }
}

bool SimulatedRadio::is_up(AgentId a, AgentId b) const { return !cuts_.contains(LinkOf(a, b)); }

double SimulatedRadio::DrawRatio() {
  // Not std::uniform_real_distribution: its numbers differ between standard libraries, so that a seed would not
  // reproduce a run.
  return static_cast<double>(rng_() >> 11) * 0x1.0p-53;
}

Duration SimulatedRadio::DrawDuration(Duration limit) {
  if (limit <= Duration::zero()) return Duration::zero();
  return Duration(static_cast<Duration::rep>(DrawRatio() * static_cast<double>(limit.count())));
}

}  // namespace moondb::simulation
