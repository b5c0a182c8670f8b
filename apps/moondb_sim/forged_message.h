// What a Byzantine agent makes up: records that look true, and messages that no agent sends. Plain functions.
#pragma once

#include <cstdint>
#include <random>

#include "model/record_key.h"
#include "proto/message.pb.h"
#include "proto/record.pb.h"

namespace moondb::simulation {

// Seqs from here on, and nodes, are never given: so many would take an agent thousands of years.
inline constexpr std::uint64_t kFarSeq = 1ull << 40;
// Forged poses are of this run or a later one; no leader solves so often.
inline constexpr std::uint64_t kForgedRunMin = 1'000'000;

// One that may have this key, and is like no other. Poses are of a node of `named` and of `term`, quarantines of the
// maps of `named`; the stamp is within a second of `clock_ns`.
proto::Record ForgedRecord(const RecordKey& key, AgentId named, const proto::Term& term, std::int64_t clock_ns,
                           std::mt19937_64& rng);

// Malformed, or out of place, at whichever actor it comes to; of what may leave an agent, up to 64 kB.
proto::Message DrawGarbage(std::mt19937_64& rng);

}  // namespace moondb::simulation
