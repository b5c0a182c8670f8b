// Damage that SQLite's own check does not detect: one changed value within a sound database file.
//
// Requires: the agent does not run, and `database` is its database, opened on the simulated disk. The functions return
// null if there is nothing to damage. Equal files and random numbers give equal damage.
#pragma once

#include <optional>
#include <random>

#include "actors/storage/sqlite_database.h"
#include "model/record_key.h"

namespace moondb::simulation {

// Changes one byte in the content of a shared record. Returns the record's key.
std::optional<RecordKey> DamageRecord(Database& database, std::mt19937_64& rng);

// A damaged interval of the have-set, with its stream. DamageInterval sets one end of the interval to another number: a
// near one, one beyond the other end, or a huge one.
struct DamagedInterval {
  StreamKey stream;
  bool is_dropped = false;
};
std::optional<DamagedInterval> DamageInterval(Database& database, std::mt19937_64& rng);

}  // namespace moondb::simulation
