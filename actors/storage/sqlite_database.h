// Database, Transaction, Query: SQLite as values and scopes; through them alone a store is written.
//
// Used from one thread at a time. Statements are prepared once and kept (4.7 times faster than SQL text). Unsigned
// 64-bit numbers are stored as the signed number of the same bits: compare them in C++, or in SQL by
// `(x < 0), x`.
//
// Errors of every call: kFull (disk or size limit), kCorrupt (damaged file, or none of SQLite's; or it is not the file
// at its path any more), kUnavailable (locked by another process), kInternal (anything else: I/O, permissions, a
// read-only file system). After an error inside a Transaction, let it go.
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

// Of a VFS that is not the system's: the file control by which it fills a DiskSpace. SQLite leaves numbers from 100 on.
inline constexpr int kDiskSpaceControl = 5301;

// One use of a prepared statement; gives it back when it goes out of scope. The same SQL cannot be in use twice.
class Query {
 public:
  Query(Query&& other) noexcept;
  Query& operator=(Query&&) = delete;
  ~Query();

  // Binds the next parameter, from the first on. Text and bytes must live until the last Step.
  Query& operator<<(std::integral auto value) { return BindInteger(static_cast<std::int64_t>(value)); }
  Query& operator<<(double value);
  Query& operator<<(std::string_view text);
  Query& operator<<(Blob blob);
  Query& operator<<(std::nullptr_t);

  // True: a row is there to be read. False: there are no more.
  Result<bool> Step();
  // Steps to the end.
  Result<void> Run();

  // Of the present row, columns from 0. The views live until the next Step.
  std::int64_t Integer(int column) const;
  std::uint64_t Unsigned(int column) const { return static_cast<std::uint64_t>(Integer(column)); }
  double Real(int column) const;
  std::string_view Bytes(int column) const;  // Text too; empty for NULL.

 private:
  friend class Database;
  struct Prepared {
    sqlite3_stmt* statement = nullptr;
    bool is_in_use = false;
  };
  Query(Database& database, Prepared* prepared, int code) : database_(&database), prepared_(prepared), code_(code) {}
  Query& BindInteger(std::int64_t value);
  void Note(int code);

  Database* database_;
  Prepared* prepared_;
  int code_;           // The first failure of preparing or binding; Step reports it.
  int parameter_ = 0;  // The last one bound.
};

class Database {
 public:
  // How much a commit survives: kFull even a power cut, kNormal a killed process.
  enum class Durability { kFull, kNormal };

  enum class Access {
    kShared,   // Other processes may read it beside this one.
    kAlone,    // None can: without the index beside the log (PATH-shm), for which a full or failing disk has no room.
    kReadOnly  // On a read-only file system; every write fails with kInternal.
  };

  using FileCheck = Result<void> (*)(Database& database);

  // Opens or creates `path` in WAL mode; ":memory:" gives one that goes with this object. A file is locked (PATH.lock)
  // against a second writer, but other processes may read it. `bytes_max` bounds the file; 0: the disk does. `vfs`:
  // another file system that is registered with SQLite, for simulations; nobody else uses it. On a read-only file
  // system the access is kReadOnly, whatever was asked for, and a file that is not there kInternal. `check`, which only
  // reads, sees the file before anything is written to it: what it refuses stays as it is, and its error is returned.
  static Result<std::unique_ptr<Database>> Open(const std::string& path, std::uint64_t bytes_max = 0,
                                                const std::string& vfs = {}, Access access = Access::kShared,
                                                FileCheck check = nullptr);
  // Renames a damaged file that is not open, with its write-ahead log, to PATH.damaged-1 or the next number that is
  // free; the new path. Of kDamagedMax such files the smallest is removed for it, and those after it move up, so that
  // an agent on a bad disk still starts. In a `vfs`: deletes the file.
  static Result<std::string> SetAside(const std::string& path, const std::string& vfs = {});
  static constexpr int kDamagedMax = 10;
  // The last file that was set aside from `path` and is still there; empty: none is. Empty in a `vfs`.
  static std::string LastSetAside(const std::string& path, const std::string& vfs = {});
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  // `sql` is one statement of ours.
  Query Prepare(const std::string& sql);

  // Any number of statements without parameters and results.
  Result<void> Execute(const std::string& sql);

  // The first column of the first row, as a number. kNotFound without a row.
  Result<std::int64_t> Number(const std::string& sql);

  // kCorrupt if the file is damaged. Reads the whole file.
  Result<void> QuickCheck();

  // Closing moves nothing from the write-ahead log into the file, for one that is damaged or another program's.
  void LeaveAsItIs();

  const std::string& path() const { return path_; }
  Access access() const { return access_; }
  bool IsOnReadOnlyFileSystem() const;
  std::uint64_t WalBytes() const;                 // Of the write-ahead log; 0 in memory.
  std::optional<DiskSpace> GetDiskSpace() const;  // Where the file lies; none in memory, and where nobody can say.
  Result<std::uint64_t> FreePageBytes();          // Within the file, free to be written again.
  // Moves what the log holds into the file, so that the log begins anew.
  Result<void> Checkpoint();
  // kCorrupt where file or log are not those at their paths any more, or the file was cut: removed, moved, replaced or
  // truncated by somebody else while it was open. What was written since reaches nobody. Two calls of stat.
  Result<void> CheckInPlace();
  // A step of a statement that takes more of SQLite's own is ended with kCorrupt: in a file of ours none does, in one
  // that somebody else has written to one may never end. kStepsMax takes minutes; reading a whole file takes some fifty
  // a row.
  static constexpr std::uint64_t kStepsMax = 10'000'000'000;
  void SetStepsMax(std::uint64_t steps) { steps_max_ = steps; }  // For tests.
  // Of what the file holds, or will when the log is moved into it: without pages that are free to be written again.
  Result<std::uint64_t> UsedPageBytes();
  // By this object, to file and log (actors/storage/counting_files.h).
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
  Result<void> CheckFile(const char* ending, std::optional<FileIdentity>& opened, std::uint64_t& bytes);
  std::uint64_t BytesByHeader() const;  // As long as the file must be, by its first page.
  tl::unexpected<Error> NotInPlace(const char* ending, const std::string& what);
  std::uint64_t FileBytes(const char* ending) const;  // Of the path with this ending; 0 where there is no such file.
  static int OnSteps(void* database);
  tl::unexpected<Error> FailWith(int code) const;
  Result<void> SetDurability(Durability durability);

  std::string path_;
  Access access_ = Access::kShared;
  bool is_on_system_ = false;  // A file that the system knows by its path.
  std::optional<FileIdentity> file_;
  std::optional<FileIdentity> log_;
  std::uint64_t file_bytes_ = 0;  // When last looked at.
  int lock_file_ = -1;
  std::unique_ptr<CountingFiles> files_;
  sqlite3* connection_ = nullptr;
  Durability durability_ = Durability::kFull;
  std::uint64_t steps_ = 0;  // Of the present step of a statement.
  std::uint64_t steps_max_ = kStepsMax;
  std::unordered_map<std::string, Query::Prepared> statements_;
};

// All or nothing: what is not committed when this goes out of scope is rolled back.
class Transaction {
 public:
  static Result<Transaction> Begin(Database& database, Database::Durability durability = Database::Durability::kFull);
  Transaction(Transaction&& other) noexcept : database_(other.database_) { other.database_ = nullptr; }
  Transaction& operator=(Transaction&&) = delete;
  ~Transaction();

  // Without an error it is durable in the file that lies at the database's path (Database::CheckInPlace).
  Result<void> Commit();

 private:
  explicit Transaction(Database& database) : database_(&database) {}
  Database* database_;
};

}  // namespace moondb
