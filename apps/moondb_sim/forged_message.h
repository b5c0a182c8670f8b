// Forges the messages of a Byzantine agent: valid records, and messages that no honest agent sends.
#pragma once

#include <cstdint>
#include <random>

#include "model/record_key.h"
#include "proto/message.pb.h"
#include "proto/record.pb.h"

namespace moondb::simulation {

// Forged seqs and node indexes start here. Honest agents would reach this number only after thousands of years.
inline constexpr std::uint64_t kFarSeq = 1ull << 40;
// The solver run numbers in forged optimized poses start here. No leader solves that often.
inline constexpr std::uint64_t kForgedRunMin = 1'000'000;

// Returns a record with unique content that is valid under `key`. An optimized pose belongs to `term` and to a node of
// agent `named`. A quarantine covers maps of agent `named`. The timestamp is less than one second after `clock_ns`.
proto::Record ForgedRecord(const RecordKey& key, AgentId named, const proto::Term& term, std::int64_t clock_ns,
                           std::mt19937_64& rng);

// Returns a random message of up to 64 kB, of a type that agents send to each other. The content is malformed or
// random.
proto::Message DrawGarbage(std::mt19937_64& rng);

}  // namespace moondb::simulation
