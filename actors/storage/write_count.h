// WriteCount counts the bytes that a store writes to its disk per day, since writing wears flash memory. The count is
// kept in memory and in the table `written`.
//
// The bytes are counted when SQLite passes them to the file system (actors/storage/counting_files.h). Not counted are
// the file system's own writes, and writes in the last minute of a process. Days follow the agent's clock. Bytes
// written in a minute across midnight count for the day in which the minute ends.
#pragma once

#include <cstdint>
#include <map>

#include "actors/storage/sqlite_database.h"

namespace moondb {

inline constexpr std::size_t kWrittenDaysKept = 14;

class WriteCount {
 public:
  Result<void> Load(Database& database);

  // Saves the count of bytes written since the last save. Does nothing if nothing was written after the last save; the
  // bytes that a save itself writes do not cause another save. Not durable, because this is only a statistic.
  Result<void> Save(Database& database, std::uint32_t day);

  // Returns the bytes written on each of the last kWrittenDaysKept days, by day since 1970. Bytes that are not saved
  // yet count for `day`.
  std::map<std::uint32_t, std::uint64_t> Days(const Database& database, std::uint32_t day) const;

 private:
  std::map<std::uint32_t, std::uint64_t> days_;  // Bytes written on each day, as last saved.
  // The part of Database::WrittenBytes that `days_` includes.
  std::uint64_t counted_ = 0;
  std::uint64_t seen_ = 0;  // Database::WrittenBytes at the end of the last save.
};

}  // namespace moondb
