// ReserveFile: bytes beside a database that are given up when the disk is full, so that a prune, a change of roles and
// a start still work there.
//
// moondb.sqlite has moondb.reserve. It holds random bytes, so that no file system stores it as less than it is, and
// it is written once and synced. At most kReserveBytesMax, on a small disk an eighth of it: more than what those
// writes need at once, that is the write-ahead log at its largest (4 MB, at which SQLite moves it into the file, and
// one record of 8 MiB) and what the file grows by when the log is moved into it.
//
// All calls go through a VFS of SQLite, so that a simulated disk has it too. Nothing but this file is ever deleted.
#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "model/error.h"

namespace moondb {

inline constexpr std::uint64_t kReserveBytesMax = 16ull << 20;
inline constexpr std::uint64_t kReservePartBytes = 1ull << 20;  // Written and synced at once.

// Of a disk of that size.
std::uint64_t ReserveBytesFor(std::uint64_t capacity_bytes);

class ReserveFile {
 public:
  // `vfs` as of Database::Open. ":memory:" has none: no bytes, and every call does nothing.
  ReserveFile(const std::string& database_path, std::string vfs);

  const std::string& path() const { return path_; }
  std::uint64_t Bytes() const;  // 0: there is none.
  // Adds one part, at most until there are `goal` bytes; durable when this returns. kFull, kInternal: nothing is lost.
  Result<void> Grow(std::uint64_t goal, std::mt19937_64& random);
  // Deletes it; whether there was one.
  bool GiveUp();

 private:
  std::string path_;  // Empty: in memory.
  std::string vfs_;
};

}  // namespace moondb
