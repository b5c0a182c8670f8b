// ReserveFile: a file beside a database that is deleted when the disk is full. The freed space is for a prune, a change
// of roles, and the writes at the start of a process.
//
// The reserve of moondb.sqlite is moondb.reserve. It is filled with random bytes, so no file system can compress it.
// The file's size is kReserveBytesMax, or an eighth of a small disk. The largest write-ahead log fits into this space:
// SQLite moves the log into the file at 4 MB, and one record may add 8 MiB. The growth of the file by this move fits
// too.
//
// All calls use a SQLite VFS, so a simulated disk has a reserve too. No other file is ever deleted.
#pragma once

#include <cstdint>
#include <random>
#include <string>

#include "model/error.h"

namespace moondb {

inline constexpr std::uint64_t kReserveBytesMax = 16ull << 20;
inline constexpr std::uint64_t kReservePartBytes = 1ull << 20;  // Bytes that one call of Grow adds and syncs.

std::uint64_t ReserveBytesFor(std::uint64_t capacity_bytes);

class ReserveFile {
 public:
  // `vfs` is as for Database::Open. For a database ":memory:" there is no reserve, and all calls do nothing.
  ReserveFile(const std::string& database_path, std::string vfs);

  const std::string& path() const { return path_; }
  std::uint64_t Bytes() const;  // 0 if there is no reserve.
  // Adds one part of kReservePartBytes, unless the reserve already has `goal` bytes. Durable on return. After an error
  // (kFull, kInternal) the existing reserve remains.
  Result<void> Grow(std::uint64_t goal, std::mt19937_64& random);
  // Deletes the reserve. Returns false if there was none, or if it could not be deleted.
  bool GiveUp();

 private:
  std::string path_;  // Empty for a database in memory.
  std::string vfs_;
};

}  // namespace moondb
