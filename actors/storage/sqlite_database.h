// Database, Transaction, Query: the C++ interface to SQLite through which all writes to a store are made.
//
// For one thread at a time. Statements are prepared once and cached, which is 4.7 times faster than preparing them for
// each use. Unsigned 64-bit numbers are stored as the signed numbers of the same bits. Compare them in C++, or in SQL
// by `(x < 0), x`.
//
// Errors of all calls:
//   - kFull: the disk is full, or the size limit is reached.
//   - kCorrupt: the file is damaged, is not a SQLite file, or is no longer the file at its path.
//   - kUnavailable: locked by another process.
//   - kInternal: anything else, such as I/O errors, permissions or a read-only file system.
// After an error inside a Transaction, destroy the Transaction.
#pragma once

#include <sys/types.h>

#include <concepts>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>

#include "model/error.h"

struct sqlite3;
struct sqlite3_stmt;

namespace moondb {

struct Blob {
  std::string_view bytes;
};

class CountingFiles;
class Database;

struct DiskSpace {
  std::uint64_t free_bytes = 0;
  std::uint64_t capacity_bytes = 0;
};

// File control by which a custom VFS fills a DiskSpace. SQLite leaves numbers from 100 on to applications.
inline constexpr int kDiskSpaceControl = 5301;

// One use of a prepared statement. The destructor makes the statement available again. Two Query objects with the same
// SQL must not exist at the same time.
class Query {
 public:
  Query(Query&& other) noexcept;
  Query& operator=(Query&&) = delete;
  ~Query();

  // Binds the next parameter, starting with the first. Text and bytes must stay valid until the last Step.
  Query& operator<<(std::integral auto value) { return BindInteger(static_cast<std::int64_t>(value)); }
  Query& operator<<(double value);
  Query& operator<<(std::string_view text);
  Query& operator<<(Blob blob);
  Query& operator<<(std::nullptr_t);
  // Binds a copy of a text that does not stay valid until the last Step.
  Query& BindCopy(std::string_view text);

  // Returns true if there is a row to read, false after the last row.
  Result<bool> Step();
  // Steps until there are no more rows.
  Result<void> Run();

  // Columns of the current row, counted from 0. The views are valid until the next Step.
  std::int64_t Integer(int column) const;
  std::uint64_t Unsigned(int column) const { return static_cast<std::uint64_t>(Integer(column)); }
  double Real(int column) const;
  std::string_view Bytes(int column) const;  // Returns text as well; empty for NULL.

 private:
  friend class Database;
  struct Prepared {
    sqlite3_stmt* statement = nullptr;
    bool is_in_use = false;
  };
  Query(Database& database, Prepared* prepared, int code) : database_(&database), prepared_(prepared), code_(code) {}
  Query& BindInteger(std::int64_t value);
  void RecordResult(int code);

  Database* database_;
  Prepared* prepared_;
  int code_;           // First error of preparing or binding; Step returns it.
  int parameter_ = 0;  // Number of the last bound parameter.
};

class Database {
 public:
  // A commit with kFull survives a power cut. A commit with kNormal survives the end of the process, but perhaps not a
  // power cut.
  enum class Durability { kFull, kNormal };

  enum class Access {
    kShared,  // Other processes may read the file at the same time.
    // Other processes cannot read the file. No shared-memory index (PATH-shm) is written, so this access works on a
    // full or failing disk.
    kAlone,
    kReadOnly  // For a read-only file system. Every write fails with kInternal.
  };

  using FileCheck = Result<void> (*)(Database& database);

  // Opens or creates `path` in WAL mode; ":memory:" makes a database that exists as long as this object. A file is
  // locked (PATH.lock) against a second writer, but other processes may read it.
  //   - `bytes_max` limits the size of the file; 0: limited by the disk only.
  //   - `vfs` names a custom file system that is registered with SQLite, for simulations; no other process uses it.
  //   - `access` becomes kReadOnly on a read-only file system. If the file is missing there, Open fails with kInternal.
  //   - `check` is called before anything is written to the file, and must only read. If `check` returns an error, the
  //     file stays unchanged and Open returns the error.
  static Result<std::unique_ptr<Database>> Open(const std::string& path, std::uint64_t bytes_max = 0,
                                                const std::string& vfs = {}, Access access = Access::kShared,
                                                FileCheck check = nullptr);
  // Renames a damaged file that is not open, with its write-ahead log, to PATH.damaged-1 or the next free number.
  // Returns the new path. If there are already kDamagedMax such files, removes the smallest one and renumbers the later
  // ones, so that an agent on a bad disk still starts. In a custom `vfs` the file is deleted.
  static Result<std::string> SetAside(const std::string& path, const std::string& vfs = {});
  static constexpr int kDamagedMax = 10;
  // Returns the path of the last file that SetAside renamed and that still exists. Returns an empty path if there is no
  // such file, or for a custom `vfs`.
  static std::string LastSetAside(const std::string& path, const std::string& vfs = {});
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  // Requires: `sql` is one statement from this program's code.
  Query Prepare(const std::string& sql);

  // Runs any number of statements that have no parameters. Discards their results.
  Result<void> Execute(const std::string& sql);

  // Returns the first column of the first row as a number. Fails with kNotFound if there are no rows.
  Result<std::int64_t> Number(const std::string& sql);

  // Reads the whole file. Fails with kCorrupt if the file is damaged. Does not compare indexes with their tables.
  Result<void> QuickCheck();

  // Like QuickCheck, and fails also if an index disagrees with its table. Takes about four times as long.
  Result<void> FullCheck();

  // Makes the destructor leave the write-ahead log as it is, instead of moving it into the file. Call this for a file
  // that is damaged or belongs to another program.
  void LeaveAsItIs();

  const std::string& path() const { return path_; }
  Access access() const { return access_; }
  bool IsOnReadOnlyFileSystem() const;
  std::uint64_t WalBytes() const;  // Size of the write-ahead log; 0 in memory.
  // Space of the disk that holds the file. Null for a database in memory, or if the space is unknown.
  std::optional<DiskSpace> GetDiskSpace() const;
  Result<std::uint64_t> FreePageBytes();  // Bytes of free pages within the file.
  // Moves the write-ahead log into the file. The log then starts again from its beginning.
  Result<void> Checkpoint();
  // Fails with kCorrupt if, since Open, another program removed, moved, replaced or truncated the file or its log.
  // Later writes would then be lost. Costs two calls of stat.
  Result<void> CheckInPlace();
  // Maximum number of steps of SQLite's virtual machine in one call of Query::Step. A call that needs more fails with
  // kCorrupt. On a file that another program changed, a statement might never end. On an intact store no statement
  // needs so many steps: reading a whole file takes some fifty steps per row. kStepsMax steps take minutes.
  static constexpr std::uint64_t kStepsMax = 10'000'000'000;
  void SetStepsMax(std::uint64_t steps) { steps_max_ = steps; }  // For tests.
  // Bytes of the pages in use, in the file and in the log. Free pages are not counted.
  Result<std::uint64_t> UsedPageBytes();
  // Bytes that this object wrote to the file and the log (actors/storage/counting_files.h).
  std::uint64_t WrittenBytes() const;

 private:
  friend class Query;
  friend class Transaction;
  struct FileIdentity {
    dev_t device;
    ino_t inode;
  };
  Database(std::string path, const std::string& vfs, Access access);
  Result<void> Lock();
  Result<void> OpenConnection(const std::string& vfs);
  Result<void> Configure(std::uint64_t bytes_max);
  Result<void> RunCheck(const std::string& sql);
  Result<void> CheckFile(const char* ending, std::optional<FileIdentity>& opened, std::uint64_t& bytes);
  std::uint64_t BytesByHeader() const;  // File length according to the file's first page.
  tl::unexpected<Error> NotInPlace(const char* ending, const std::string& what);
  // Returns the size of the file PATH + `ending`; 0 if it does not exist.
  std::uint64_t FileBytes(const char* ending) const;
  static int OnSteps(void* database);
  tl::unexpected<Error> FailWith(int code) const;
  Result<void> SetDurability(Durability durability);

  std::string path_;
  Access access_ = Access::kShared;
  bool is_on_system_ = false;  // False for a database in memory or in a custom VFS.
  std::optional<FileIdentity> file_;
  std::optional<FileIdentity> log_;
  std::uint64_t file_bytes_ = 0;  // File size at the last check.
  int lock_file_ = -1;
  std::unique_ptr<CountingFiles> files_;
  sqlite3* connection_ = nullptr;
  Durability durability_ = Durability::kFull;
  std::uint64_t steps_ = 0;  // Steps of the virtual machine in the current call of Query::Step.
  std::uint64_t steps_max_ = kStepsMax;
  std::unordered_map<std::string, Query::Prepared> statements_;
};

// A transaction. The destructor rolls back if it was not committed.
class Transaction {
 public:
  static Result<Transaction> Begin(Database& database, Database::Durability durability = Database::Durability::kFull);
  Transaction(Transaction&& other) noexcept : database_(other.database_) { other.database_ = nullptr; }
  Transaction& operator=(Transaction&&) = delete;
  ~Transaction();

  // After a success, the transaction is in the file at the database's path (Database::CheckInPlace), and as durable as
  // the `durability` given to Begin.
  Result<void> Commit();

 private:
  explicit Transaction(Database& database) : database_(&database) {}
  Database* database_;
};

}  // namespace moondb
