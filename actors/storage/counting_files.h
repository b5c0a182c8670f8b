// CountingFiles: a SQLite VFS that counts the bytes that SQLite writes to its files, to measure the wear of flash
// memory. Wraps another VFS and forwards all calls to it.
//
// Not counted are the file system's own writes (its journal, rounding up to whole blocks), and the shared-memory index
// beside a write-ahead log (32 KiB, rewritten in place).
//
// Must outlive the connections that were opened through it. Cannot be moved. For one thread at a time.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <string>

namespace moondb {

class CountingFiles {
 public:
  // Wraps the registered VFS with the name `base`; empty means SQLite's default VFS.
  explicit CountingFiles(const std::string& base);
  ~CountingFiles();
  CountingFiles(const CountingFiles&) = delete;
  CountingFiles& operator=(const CountingFiles&) = delete;

  // The VFS name to pass to sqlite3_open_v2.
  const char* name() const { return name_.c_str(); }
  std::uint64_t written_bytes() const { return written_bytes_; }

 private:
  // `base` must be the first member: SQLite passes a pointer to `base` to Open, which casts the pointer to Vfs.
  struct Vfs {
    sqlite3_vfs base{};
    CountingFiles* owner = nullptr;
  };
  // This VFS's data of one file, stored behind the file object of the wrapped VFS.
  struct FileTail;

  static int Open(sqlite3_vfs* vfs, const char* path, sqlite3_file* file, int flags, int* flags_out);
  static int Write(sqlite3_file* file, const void* bytes, int count, sqlite3_int64 offset);
  static FileTail& TailOf(sqlite3_file* file, int base_bytes);

  std::string name_;
  sqlite3_vfs* base_;
  Vfs vfs_;
  std::uint64_t written_bytes_ = 0;
};

}  // namespace moondb
