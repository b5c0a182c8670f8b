// WriteCount: how many bytes a store writes to its disk a day, in memory and in the table `written`, because flash
// wears.
//
// Counted where SQLite hands bytes to the file system (actors/storage/counting_files.h): what that one writes beyond
// them is not in it, and what a process wrote in the last minute before its end. The day is the agent's clock's,
// and a minute across midnight counts for the day that it ends in.
#pragma once

#include <cstdint>
#include <map>

#include "actors/storage/sqlite_database.h"

namespace moondb {

inline constexpr std::size_t kWrittenDaysKept = 14;

class WriteCount {
 public:
  Result<void> Load(Database& database);

  // Writes down what came since the last time, if anything did but this writing down. Not durable: it is a statistic.
  Result<void> Save(Database& database, std::uint32_t day);

  // By day since 1970, with what is not saved yet counted for `day`; the last kWrittenDaysKept.
  std::map<std::uint32_t, std::uint64_t> Days(const Database& database, std::uint32_t day) const;

 private:
  std::map<std::uint32_t, std::uint64_t> days_;  // As saved.
  std::uint64_t counted_ = 0;                    // Of Database::WrittenBytes, in days_.
  std::uint64_t seen_ = 0;                       // The count when the last saving had ended.
};

}  // namespace moondb
