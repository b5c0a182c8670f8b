// TraceRing: the last things that one thread's actors did, always kept, for the moment something went wrong.
//
// One thread adds (about 5 ns), any thread reads at the same time, a signal handler too: all words are atomic, and what
// was overwritten while it was read is left out.
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
  static constexpr std::uint16_t kNobody = 0xFFFF;  // As a name: none of this agent's actors.

  Ticks time = 0;  // The simulation's are nanoseconds.
  proto::TraceKind kind = proto::TRACE_SENT;
  SendResult result = SendResult::kAccepted;
  std::uint16_t body = 0;  // proto::Message::BodyCase.
  std::uint16_t actor = kNobody;
  std::uint16_t other_actor = kNobody;
  AgentId other_agent = 0;
  std::uint32_t bytes = 0;  // 0 for what was not counted.
  std::uint64_t request_id = 0;
  Ticks duration = 0;
};

class TraceRing {
 public:
  static constexpr std::size_t kRecords = 1024;

  void Add(const TraceRecord& record);
  // Oldest first.
  std::vector<TraceRecord> Read() const;

  // For signal handlers: the record of that number if it is still kept. They are numbered from 0 to count() - 1.
  bool Read(std::uint64_t number, TraceRecord* record) const;
  std::uint64_t count() const { return count_.load(std::memory_order_acquire); }

 private:
  using Words = std::array<std::atomic<std::uint64_t>, 5>;

  std::array<Words, kRecords> slots_{};
  std::atomic<std::uint64_t> count_ = 0;
};

}  // namespace moondb
