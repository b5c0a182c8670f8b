// CountingFiles: the files that SQLite works on, with a count of the bytes that it writes to them. Flash wears by bytes
// written, and only the file system that SQLite calls (its VFS) sees all of them: log, checkpoints, what is rolled
// back.
//
// Stands before another VFS and passes all on. What that one writes by itself is not in the count: the file system's
// journal and block sizes, and the shared-memory index beside a write-ahead log (32 KiB, rewritten in place).
//
// Outlives the connections that were opened through it. Not moved. One thread at a time.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <string>

namespace moondb {

class CountingFiles {
 public:
  // Before the VFS of that name, which is registered; empty: SQLite's default.
  explicit CountingFiles(const std::string& base);
  ~CountingFiles();
  CountingFiles(const CountingFiles&) = delete;
  CountingFiles& operator=(const CountingFiles&) = delete;

  // As sqlite3_open_v2 wants it.
  const char* name() const { return name_.c_str(); }
  std::uint64_t written_bytes() const { return written_bytes_; }

 private:
  // SQLite's part first: it hands this back where it opens a file.
  struct Vfs {
    sqlite3_vfs base{};
    CountingFiles* owner = nullptr;
  };
  struct FileTail;  // Behind the other VFS' own file object.

  static int Open(sqlite3_vfs* vfs, const char* path, sqlite3_file* file, int flags, int* flags_out);
  static int Write(sqlite3_file* file, const void* bytes, int count, sqlite3_int64 offset);
  static FileTail& TailOf(sqlite3_file* file, int base_bytes);

  std::string name_;
  sqlite3_vfs* base_;
  Vfs vfs_;
  std::uint64_t written_bytes_ = 0;
};

}  // namespace moondb
