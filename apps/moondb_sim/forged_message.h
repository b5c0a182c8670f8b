// Messages that a Byzantine agent forges: records that look true, and messages that no honest agent sends. Free
// functions.
#pragma once

#include <cstdint>
#include <random>

#include "model/record_key.h"
#include "proto/message.pb.h"
#include "proto/record.pb.h"

namespace moondb::simulation {

// Forged seqs and node indexes start here. Honest agents would reach this number only after thousands of years.
inline constexpr std::uint64_t kFarSeq = 1ull << 40;
// Run numbers of forged poses start here. No leader solves that often.
inline constexpr std::uint64_t kForgedRunMin = 1'000'000;

// Returns a record with unique content that is valid under `key`. Poses are of a node of `named` and have `term`;
// quarantines are for maps of `named`. The timestamp is within one second of `clock_ns`.
proto::Record ForgedRecord(const RecordKey& key, AgentId named, const proto::Term& term, std::int64_t clock_ns,
                           std::mt19937_64& rng);

// Returns a malformed or misplaced message of up to 64 kB. Its kind is one that may leave an agent.
proto::Message DrawGarbage(std::mt19937_64& rng);

}  // namespace moondb::simulation
