// TraceRing: the latest events of one thread's actors, always recorded for diagnosis.
//
// One thread adds records (about 5 ns each). Other threads and signal handlers may read concurrently, because all words
// are atomic. A record that is overwritten while it is read is skipped.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <vector>

#include "proto/trace.pb.h"
#include "runtime/actor.h"
#include "runtime/tick_clock.h"

namespace moondb {

struct TraceRecord {
  static constexpr std::uint16_t kNobody = 0xFFFF;  // Value of `actor` and `other_actor` for no actor of this agent.

  Ticks time = 0;  // Time of the event in ticks; in simulation, in nanoseconds.
  proto::TraceKind kind = proto::TRACE_SENT;
  SendResult result = SendResult::kAccepted;
  std::uint16_t body = 0;  // Body of the message, a proto::Message::BodyCase.
  std::uint16_t actor = kNobody;
  std::uint16_t other_actor = kNobody;
  AgentId other_agent = 0;
  std::uint32_t bytes = 0;  // Size of the message; 0 if not recorded.
  std::uint64_t request_id = 0;
  Ticks duration = 0;
};

class TraceRing {
 public:
  static constexpr std::size_t kRecords = 1024;

  void Add(const TraceRecord& record);
  // Returns the kept records, oldest first.
  std::vector<TraceRecord> Read() const;

  // Reads the record with this number, from 0 to count() - 1. Returns false if that record is no longer kept. Safe in
  // signal handlers.
  bool Read(std::uint64_t number, TraceRecord* record) const;
  std::uint64_t count() const { return count_.load(std::memory_order_acquire); }

 private:
  using Words = std::array<std::atomic<std::uint64_t>, 5>;

  std::array<Words, kRecords> slots_{};
  std::atomic<std::uint64_t> count_ = 0;
};

}  // namespace moondb
