// Changes one value in a database file. The file stays sound, so SQLite's own check does not detect the damage.
//
// Requires: the agent does not run, and `database` is its database on the simulated disk. The functions return null if
// there is nothing to damage. Equal files and random numbers give equal damage.
#pragma once

#include <optional>
#include <random>

#include "actors/storage/sqlite_database.h"
#include "model/record_key.h"

namespace moondb::simulation {

// Changes one byte in the content of a shared record. Returns the record's key.
std::optional<RecordKey> DamageRecord(Database& database, std::mt19937_64& rng);

// A damaged interval of the have-set, with its stream. DamageInterval replaces the first or the last seq of the
// interval by another number, which may be negative or huge.
struct DamagedInterval {
  StreamKey stream;
  bool is_dropped = false;
};
std::optional<DamagedInterval> DamageInterval(Database& database, std::mt19937_64& rng);

}  // namespace moondb::simulation
