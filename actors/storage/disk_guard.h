// DiskGuard: what a store does about a disk that is nearly full, full or failing.
//
//   room below              what is refused (kFull)
//   twice the reserve       maps
//   half of it, or less     every record: what is left is for roles, and for a prune, which makes room
//   than the log needs
//
// Room is what is free on the disk and, since a file never becomes smaller, the pages within it that are free to be
// written again. Where SQLite says that the disk is full all the same, the reserve (actors/storage/reserve_file.h) is
// given up for what has to go on; it is made anew, slowly, when there is room for it above all limits.
//
// Remembers why the last write failed, until one succeeds. In memory there is no disk, and nothing is refused.
//
// From one thread at a time.
#pragma once

#include <optional>
#include <random>
#include <string>

#include "actors/storage/reserve_file.h"
#include "actors/storage/sqlite_database.h"

namespace moondb::proto {
class StorageStatus;
}  // namespace moondb::proto

namespace moondb {

// An error that comes from the disk and may go away with its cause: it is full, cannot be written, or fails.
bool IsOfTheDisk(const Error& error);

// What an operator may delete beside a database, with sizes, the largest first: "moondb.sqlite.damaged-1 (12 MB) and
// agent.log (3 MB) in /data/rover1". Empty: there is nothing.
std::string DeletableFiles(const std::string& database_path);

class DiskGuard {
 public:
  // `agent` is the name by which an operator prunes it.
  DiskGuard(const std::string& database_path, const std::string& vfs, std::string agent);

  enum class Kind { kMap, kRecord };
  // Whether a record of that kind may be stored now; kFull, or kInternal where the file system takes no write.
  Result<void> CheckRoom(Database& database, Kind kind) const;

  // Gives up the reserve if the file has room for records, but the disk has none for the log through which they are
  // written. True: the reserve was given up.
  bool MakeRoomForLog(Database& database);

  // After a write failed with kFull: whether something was given up for it, so that it is worth another attempt.
  bool GiveUpReserve(Database& database);

  // Of every write: why it failed, or that it did not. True: the trouble has just begun, or is another one.
  bool NoteFailure(const Database& database, const Error& error);
  bool NoteSuccess();  // True: it has just ended.
  const std::string& trouble() const { return trouble_; }

  // Now and then: adds a part to the reserve where there is room for it. True: another one is due soon.
  bool Tend(Database& database, std::mt19937_64& random);

  // What StorageStatus says of all this.
  void Describe(Database& database, proto::StorageStatus& status) const;

  // What to do about a disk that is full, as the end of a sentence.
  std::string Advice() const;

 private:
  struct Room {
    std::uint64_t disk_bytes = 0;     // Free on it.
    std::uint64_t bytes = 0;          // And what is free within the file.
    std::uint64_t log_bytes = 0;      // Of the log, which is written anew from its beginning.
    std::uint64_t reserve_bytes = 0;  // As large as the reserve is to be.
  };
  std::optional<Room> RoomOf(Database& database) const;

  const std::string path_;
  const bool is_on_disk_;
  const std::string agent_;
  ReserveFile reserve_;
  bool is_reserve_whole_ = false;  // When last looked at: it is not looked at again.
  std::string trouble_;
};

}  // namespace moondb
