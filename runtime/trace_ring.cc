#include "runtime/trace_ring.h"

#include <algorithm>

namespace moondb {

void TraceRing::Add(const TraceRecord& record) {
  const std::uint64_t number = count_.load(std::memory_order_relaxed);
  Words& words = slots_[number % kRecords];
  const std::uint64_t what = static_cast<std::uint64_t>(record.kind) << 56 |
                             static_cast<std::uint64_t>(record.result) << 48 | std::uint64_t{record.body} << 32 |
                             std::uint64_t{record.actor} << 16 | record.other_actor;
  // Store in release order: a reader that sees one of these words also sees the earlier store of the count, and so can
  // detect that this slot is being overwritten.
  words[0].store(static_cast<std::uint64_t>(record.time), std::memory_order_release);
  words[1].store(what, std::memory_order_release);
  words[2].store(std::uint64_t{record.other_agent} << 32 | record.bytes, std::memory_order_release);
  words[3].store(record.request_id, std::memory_order_release);
  words[4].store(static_cast<std::uint64_t>(record.duration), std::memory_order_release);
  count_.store(number + 1, std::memory_order_release);
}

bool TraceRing::Read(std::uint64_t number, TraceRecord* record) const {
  const Words& words = slots_[number % kRecords];
  record->time = static_cast<Ticks>(words[0].load(std::memory_order_acquire));
  const std::uint64_t what = words[1].load(std::memory_order_acquire);
  const std::uint64_t agent_and_bytes = words[2].load(std::memory_order_acquire);
  record->request_id = words[3].load(std::memory_order_acquire);
  record->duration = static_cast<Ticks>(words[4].load(std::memory_order_acquire));
  record->kind = static_cast<proto::TraceKind>(what >> 56);
  record->result = static_cast<SendResult>(what >> 48 & 0xFF);
  record->body = static_cast<std::uint16_t>(what >> 32);
  record->actor = static_cast<std::uint16_t>(what >> 16);
  record->other_actor = static_cast<std::uint16_t>(what);
  record->other_agent = static_cast<AgentId>(agent_and_bytes >> 32);
  record->bytes = static_cast<std::uint32_t>(agent_and_bytes);
  // Record number `added` may be partly written. It overwrites record `added - kRecords`, which must not be returned.
  const std::uint64_t added = count();
  return number < added && number + kRecords > added;
}

std::vector<TraceRecord> TraceRing::Read() const {
  std::vector<TraceRecord> records;
  const std::uint64_t added = count();
  for (std::uint64_t number = added - std::min<std::uint64_t>(added, kRecords); number < added; ++number) {
    TraceRecord record;
    if (Read(number, &record)) records.push_back(record);
  }
  return records;
}

}  // namespace moondb
