// Forgeries of a Byzantine agent: records that look true, and messages that no honest agent sends. Free functions.
#pragma once

#include <cstdint>
#include <random>

#include "model/record_key.h"
#include "proto/message.pb.h"
#include "proto/record.pb.h"

namespace moondb::simulation {

// Honest agents never assign seqs and node indexes from here on: that would take thousands of years.
inline constexpr std::uint64_t kFarSeq = 1ull << 40;
// Forged poses have this run or a later one. No leader solves that often.
inline constexpr std::uint64_t kForgedRunMin = 1'000'000;

// Returns a record with unique content that may have this key. Poses name a node of `named` and have `term`;
// quarantines name maps of `named`. The timestamp is within one second of `clock_ns`.
proto::Record ForgedRecord(const RecordKey& key, AgentId named, const proto::Term& term, std::int64_t clock_ns,
                           std::mt19937_64& rng);

// Returns a malformed or misplaced message of up to 64 kB, of a kind that may leave an agent.
proto::Message DrawGarbage(std::mt19937_64& rng);

}  // namespace moondb::simulation
