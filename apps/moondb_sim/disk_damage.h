// Damage that SQLite's own check does not see: one value within a sound database file.
//
// The agent does not run; the database is its own, opened with the simulated disk's file system. Nothing where there is
// nothing to damage. Equal files and numbers give equal damage.
#pragma once

#include <optional>
#include <random>

#include "actors/storage/sqlite_database.h"
#include "model/record_key.h"

namespace moondb::simulation {

// One byte of a shared record's content becomes another; which record.
std::optional<RecordKey> DamageRecord(Database& database, std::mt19937_64& rng);

// One end of an interval of the have-set becomes another number: a near one, one beyond the other end, or a huge one.
struct DamagedInterval {
  StreamKey stream;
  bool is_dropped = false;
};
std::optional<DamagedInterval> DamageInterval(Database& database, std::mt19937_64& rng);

}  // namespace moondb::simulation
