// SimulatedRadio: decides whether and when a message between agents arrives. It uses only the sizes and times of
// messages.
//
// Single-threaded and seeded: the same calls in the same order give the same results.
#pragma once

#include <cstdint>
#include <map>
#include <random>
#include <utility>
#include <vector>

#include "runtime/actor.h"

namespace moondb::simulation {

struct RadioOptions {
  Duration latency = std::chrono::milliseconds(1);
  Duration latency_jitter{};   // Maximum of a random addition to the latency. Above 0, messages may be reordered.
  double loss_ratio = 0;       // Probability of loss per message, 0 to 1.
  double duplicate_ratio = 0;  // Probability of a second delivery, up to duplicate_delay_max later.
  Duration duplicate_delay_max = std::chrono::seconds(30);
  double bytes_per_second = 0;  // Bandwidth of each sender; 0: unlimited.
  // Limit of bytes that wait at one sender. A message larger than the limit is accepted if no other waits.
  std::size_t outbox_bytes_max = 256 * 1024;
};

class SimulatedRadio {
 public:
  explicit SimulatedRadio(std::uint64_t seed) : rng_(seed) {}

  struct Flight {
    SendResult result = SendResult::kAccepted;
    MonotonicTime departure;              // Time at which the last byte leaves the sender.
    std::vector<MonotonicTime> arrivals;  // Arrival times; empty if the message is lost.
  };

  // Sends a message of `bytes` bytes. Flight::result is kUnreachable if the link is cut and both ends know of the cut,
  // and kFull if the sender's outbox is full.
  Flight Transmit(AgentId from, AgentId to, std::size_t bytes, MonotonicTime now);

  // Cuts or restores a link. After a cut with `is_known`, Transmit returns kUnreachable. After a cut without
  // `is_known`, Transmit accepts messages and loses them.
  void SetLink(AgentId a, AgentId b, bool is_up, bool is_known);
  bool is_up(AgentId a, AgentId b) const;

  // Drops the outbox of an agent that stopped.
  void ClearOutbox(AgentId agent) { outbox_empty_at_.erase(agent); }

  RadioOptions& options() { return options_; }
  std::uint64_t bytes() const { return bytes_; }  // Bytes sent, including the bytes of lost messages.

 private:
  enum class Cut { kUnknown, kKnown };
  using Link = std::pair<AgentId, AgentId>;

  static Link LinkOf(AgentId a, AgentId b) { return a < b ? Link(a, b) : Link(b, a); }
  double DrawRatio();                     // Returns a uniform number in [0, 1).
  Duration DrawDuration(Duration limit);  // Returns a uniform duration in [0, limit).
  Duration DrawLatency() { return options_.latency + DrawDuration(options_.latency_jitter); }

  RadioOptions options_;
  std::mt19937_64 rng_;
  std::map<Link, Cut> cuts_;  // Links that are not up.
  std::map<AgentId, MonotonicTime> outbox_empty_at_;
  std::uint64_t bytes_ = 0;
};

}  // namespace moondb::simulation
