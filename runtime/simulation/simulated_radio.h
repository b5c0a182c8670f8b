// SimulatedRadio: when, and whether, what one agent sends reaches another. Knows sizes and times, never contents.
//
// Single-threaded, seeded: the same calls in the same order give the same answers.
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
  Duration latency_jitter{};   // Uniform on top; above 0 messages may overtake each other.
  double loss_ratio = 0;       // 0 to 1, per message.
  double duplicate_ratio = 0;  // Delivered a second time, up to duplicate_delay_max later.
  Duration duplicate_delay_max = std::chrono::seconds(30);
  double bytes_per_second = 0;                // Of each sender; 0: unlimited.
  std::size_t outbox_bytes_max = 256 * 1024;  // Waiting at one sender for its rate; a larger message fits alone.
};

class SimulatedRadio {
 public:
  explicit SimulatedRadio(std::uint64_t seed) : rng_(seed) {}

  struct Flight {
    SendResult result = SendResult::kAccepted;
    MonotonicTime departure;              // The last byte leaves the sender.
    std::vector<MonotonicTime> arrivals;  // None: lost.
  };

  // kUnreachable if the link was cut and the ends know it, kFull if the sender's outbox is.
  Flight Transmit(AgentId from, AgentId to, std::size_t bytes, MonotonicTime now);

  // `is_known`: the ends learn it; until then they send into a cut link and lose it.
  void SetLink(AgentId a, AgentId b, bool is_up, bool is_known);
  bool is_up(AgentId a, AgentId b) const;

  // The agent stopped: its outbox is gone.
  void ClearOutbox(AgentId agent) { outbox_empty_at_.erase(agent); }

  RadioOptions& options() { return options_; }
  std::uint64_t bytes() const { return bytes_; }  // Sent, lost ones too.

 private:
  enum class Cut { kUnknown, kKnown };
  using Link = std::pair<AgentId, AgentId>;

  static Link LinkOf(AgentId a, AgentId b) { return a < b ? Link(a, b) : Link(b, a); }
  double DrawRatio();                     // Uniform in [0, 1).
  Duration DrawDuration(Duration limit);  // Uniform in [0, limit).
  Duration DrawLatency() { return options_.latency + DrawDuration(options_.latency_jitter); }

  RadioOptions options_;
  std::mt19937_64 rng_;
  std::map<Link, Cut> cuts_;  // Links that are not up.
  std::map<AgentId, MonotonicTime> outbox_empty_at_;
  std::uint64_t bytes_ = 0;
};

}  // namespace moondb::simulation
