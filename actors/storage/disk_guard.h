// DiskGuard decides which records a store refuses if its disk is nearly full, and frees reserved space if the disk is
// full. It also remembers why the last write to the disk failed, until a write succeeds.
//
// Records are refused with kFull:
//   - other agents' maps, if the room is less than three times the reserve;
//   - all maps, if the room is less than twice the reserve;
//   - all records, if the room is less than half the reserve, or if the disk has less free space than the write-ahead
//     log needs. The remaining room is for role assignments, and for a prune, which makes room.
//
// Room is the free disk space plus the free pages within the file, since a database file never shrinks. If SQLite
// reports a full disk in spite of these limits, the reserve (actors/storage/reserve_file.h) is deleted, so role
// assignments and prunes can be written. The reserve is later rebuilt part by part.
//
// A database in memory has no disk, so nothing is refused.
//
// For one thread at a time.
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

// Returns true if the disk caused the error (full, not writable or failing). The same write may then succeed later.
bool IsOfTheDisk(const Error& error);

// Returns a text that lists the files beside a database that an operator may delete, largest first:
// "moondb.sqlite.damaged-1 (12 MB) and agent.log (3 MB) in /data/rover1". Returns an empty text if there are none.
std::string DeletableFiles(const std::string& database_path);

class DiskGuard {
 public:
  // `agent` is the agent's name, for the prune command that Advice suggests.
  DiskGuard(const std::string& database_path, const std::string& vfs, std::string agent);

  enum class Kind { kOthersMap, kMap, kRecord };
  // Returns an error if no record of that kind may be stored now: kFull, or kInternal if the file system is read-only.
  Result<void> CheckRoom(Database& database, Kind kind) const;

  // Deletes the reserve file if the database file has room for records, but the disk has no room for the write-ahead
  // log. Returns true if this freed space.
  bool MakeRoomForLog(Database& database);

  // Call after a write failed with kFull. Deletes the reserve file, and moves the write-ahead log into the database
  // file. Returns true if this freed space; the caller should then repeat the write.
  bool GiveUpReserve(Database& database);

  // Call ObserveFailure or ObserveSuccess after every write. ObserveFailure returns true if the disk caused the error
  // and the failure differs from the last one.
  bool ObserveFailure(const Database& database, const Error& error);
  bool ObserveSuccess();  // Returns true if a disk failure was noted since the last success.
  const std::string& trouble() const { return trouble_; }

  // Call periodically. Adds one part to the reserve if there is room. Returns true if a part was added; the caller
  // should then call Tend again soon.
  bool Tend(Database& database, std::mt19937_64& random);

  // Fills the fields of StorageStatus about the disk.
  void Describe(Database& database, proto::StorageStatus& status) const;

  // Advice for an operator about a full disk, as the end of a sentence.
  std::string Advice() const;

 private:
  struct Room {
    std::uint64_t disk_bytes = 0;     // Free bytes on the disk.
    std::uint64_t bytes = 0;          // `disk_bytes` plus the free pages within the file.
    std::uint64_t log_bytes = 0;      // Size of the write-ahead log, which SQLite can overwrite.
    std::uint64_t reserve_bytes = 0;  // The intended size of the reserve.
  };
  std::optional<Room> RoomOf(Database& database) const;

  const std::string path_;
  const bool is_on_disk_;
  const std::string agent_;
  ReserveFile reserve_;
  // True after a check found the reserve complete. Tend then does nothing.
  bool is_reserve_whole_ = false;
  std::string trouble_;
};

}  // namespace moondb
