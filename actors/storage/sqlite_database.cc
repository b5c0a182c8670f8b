#include "actors/storage/sqlite_database.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "actors/storage/counting_files.h"
#include "actors/storage/reserve_file.h"
#include "model/check.h"

namespace moondb {

namespace {

constexpr char kInMemory[] = ":memory:";
constexpr int kBusyTimeout_ms = 2000;
constexpr int kStepsBetweenLooks = 100'000;
constexpr std::uint64_t kPageBytes = 4096;  // Default of SQLite.
// SQLite moves the log into the file when the log reaches this length.
constexpr std::uint64_t kLogPagesMax = 1000;
constexpr std::uint64_t kLogPagesMin = 16;  // kLogPagesMax is reduced to this on a tiny disk.
// After a checkpoint, SQLite truncates a longer log to this length.
constexpr std::uint64_t kLogBytesKept = 16ull << 20;

std::string AsidePath(const std::string& path, int number) { return path + ".damaged-" + std::to_string(number); }

// Renames a file and its log, the log first. Otherwise a crash between the two renames would leave a log that SQLite
// takes for the log of the next file at this path.
Result<void> MoveFile(const std::string& from, const std::string& to) {
  for (const char* ending : {"-wal", ""}) {
    std::error_code error;
    if (!std::filesystem::exists(from + ending, error)) continue;
    std::filesystem::rename(from + ending, to + ending, error);
    if (error) return Fail(ErrorCode::kInternal, "cannot rename " + from + ending + ": " + error.message());
  }
  return {};
}

// Returns the path to which the next damaged file is renamed. If there are already Database::kDamagedMax such files,
// removes the smallest file and renumbers the later files.
Result<std::string> FreeAsidePath(const std::string& path) {
  int smallest = 1;
  std::uintmax_t smallest_bytes = UINTMAX_MAX;
  for (int number = 1; number <= Database::kDamagedMax; ++number) {
    const std::string file = AsidePath(path, number);
    std::error_code error;
    const bool is_taken = std::filesystem::exists(file, error);
    if (error) return Fail(ErrorCode::kInternal, "cannot inspect " + file + ": " + error.message());
    if (!is_taken) return file;
    std::uintmax_t bytes = std::filesystem::file_size(file, error);
    const std::uintmax_t log_bytes = std::filesystem::file_size(file + "-wal", error);
    if (!error) bytes += log_bytes;
    if (bytes < smallest_bytes) {
      smallest_bytes = bytes;
      smallest = number;
    }
  }
  spdlog::error("storage: {} damaged stores lie beside {}: the smallest of them is removed now; check the disk",
                Database::kDamagedMax, path);
  for (const char* ending : {"-wal", ""}) {
    std::error_code error;
    std::filesystem::remove(AsidePath(path, smallest) + ending, error);
    if (error) return Fail(ErrorCode::kInternal, "cannot remove " + AsidePath(path, smallest) + ": " + error.message());
  }
  for (int number = smallest; number < Database::kDamagedMax; ++number) {
    const Result<void> moved = MoveFile(AsidePath(path, number + 1), AsidePath(path, number));
    if (!moved) return tl::unexpected(moved.error());
  }
  return AsidePath(path, Database::kDamagedMax);
}

ErrorCode CodeOf(int sqlite_code) {
  switch (sqlite_code & 0xFF) {
    case SQLITE_FULL:
      return ErrorCode::kFull;
    case SQLITE_READONLY:
      return sqlite_code == SQLITE_READONLY_DBMOVED ? ErrorCode::kCorrupt : ErrorCode::kInternal;
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return ErrorCode::kCorrupt;
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return ErrorCode::kUnavailable;
    default:
      return ErrorCode::kInternal;
  }
}

std::filesystem::path FolderOf(const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  return folder.empty() ? "." : folder;
}

bool IsReadOnly(const std::string& path) {
  struct statvfs status {};
  return ::statvfs(FolderOf(path).c_str(), &status) == 0 && (status.f_flag & ST_RDONLY) != 0;
}

// Returns "file:PATH". Escapes characters that have a meaning in a URI.
std::string UriOf(const std::string& path) {
  std::string uri = "file:";
  for (const char letter : path) {
    if (letter == '%' || letter == '?' || letter == '#') {
      constexpr char kDigits[] = "0123456789abcdef";
      uri += {'%', kDigits[(letter >> 4) & 15], kDigits[letter & 15]};
    } else {
      uri += letter;
    }
  }
  return uri;
}

}  // namespace

Query::Query(Query&& other) noexcept
    : database_(other.database_),
      prepared_(std::exchange(other.prepared_, nullptr)),
      code_(other.code_),
      parameter_(other.parameter_) {}

Query::~Query() {
  if (!prepared_) return;
  sqlite3_reset(prepared_->statement);
  sqlite3_clear_bindings(prepared_->statement);
  prepared_->is_in_use = false;
}

void Query::RecordResult(int code) {
  Check(code != SQLITE_RANGE && code != SQLITE_MISUSE, "a query binds the parameters that its SQL has");
  if (code_ == SQLITE_OK) code_ = code;
}

Query& Query::BindInteger(std::int64_t value) {
  if (prepared_) RecordResult(sqlite3_bind_int64(prepared_->statement, ++parameter_, value));
  return *this;
}

Query& Query::operator<<(double value) {
  if (prepared_) RecordResult(sqlite3_bind_double(prepared_->statement, ++parameter_, value));
  return *this;
}

Query& Query::operator<<(std::string_view text) {
  // A null pointer would bind NULL instead of an empty text.
  const char* bytes = text.data() ? text.data() : "";
  if (prepared_) {
    RecordResult(
        sqlite3_bind_text64(prepared_->statement, ++parameter_, bytes, text.size(), SQLITE_STATIC, SQLITE_UTF8));
  }
  return *this;
}

Query& Query::BindCopy(std::string_view text) {
  const char* bytes = text.data() ? text.data() : "";
  if (prepared_) {
    RecordResult(
        sqlite3_bind_text64(prepared_->statement, ++parameter_, bytes, text.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  return *this;
}

Query& Query::operator<<(Blob blob) {
  const char* bytes = blob.bytes.data() ? blob.bytes.data() : "";
  if (prepared_) {
    RecordResult(sqlite3_bind_blob64(prepared_->statement, ++parameter_, bytes, blob.bytes.size(), SQLITE_STATIC));
  }
  return *this;
}

Query& Query::operator<<(std::nullptr_t) {
  if (prepared_) RecordResult(sqlite3_bind_null(prepared_->statement, ++parameter_));
  return *this;
}

Result<bool> Query::Step() {
  if (code_ != SQLITE_OK) return database_->FailWith(code_);
  database_->steps_ = 0;
  const int code = sqlite3_step(prepared_->statement);
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  code_ = code;
  return database_->FailWith(code);
}

Result<void> Query::Run() {
  while (true) {
    const Result<bool> row = Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return {};
  }
}

std::int64_t Query::Integer(int column) const { return sqlite3_column_int64(prepared_->statement, column); }

double Query::Real(int column) const { return sqlite3_column_double(prepared_->statement, column); }

std::string_view Query::Bytes(int column) const {
  const void* bytes = sqlite3_column_blob(prepared_->statement, column);
  const int size = sqlite3_column_bytes(prepared_->statement, column);
  return bytes ? std::string_view(static_cast<const char*>(bytes), size) : std::string_view();
}

// With kReadOnly, no locks are used ("unix-none"): on a read-only file system no process can write, and lock files may
// be missing.
Database::Database(std::string path, const std::string& vfs, Access access)
    : path_(std::move(path)),
      access_(access),
      is_on_system_(vfs.empty() && path_ != kInMemory),
      files_(std::make_unique<CountingFiles>(access == Access::kReadOnly ? "unix-none" : vfs)) {}

Result<std::unique_ptr<Database>> Database::Open(const std::string& path, std::uint64_t bytes_max,
                                                 const std::string& vfs, Access access, FileCheck check) {
  const bool is_on_system = vfs.empty() && path != kInMemory;
  if (is_on_system && IsReadOnly(path)) access = Access::kReadOnly;
  std::unique_ptr<Database> database(new Database(path, vfs, access));
  if (is_on_system) {
    if (const Result<void> locked = database->Lock(); !locked) return tl::unexpected(locked.error());
  }
  if (const Result<void> opened = database->OpenConnection(vfs); !opened) return tl::unexpected(opened.error());
  if (check != nullptr) {
    if (const Result<void> checked = check(*database); !checked) {
      database->LeaveAsItIs();
      return tl::unexpected(checked.error());
    }
  }
  if (const Result<void> done = database->Configure(bytes_max); !done) return tl::unexpected(done.error());
  if (const Result<void> there = database->CheckInPlace(); !there) return tl::unexpected(there.error());
  return database;
}

Result<void> Database::OpenConnection(const std::string& vfs) {
  std::string name = path_;
  int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX;
  if (access_ == Access::kReadOnly) {
    // If there is a log, SQLite must read it too. If there is no log, `immutable` keeps SQLite from trying to create
    // one.
    name = UriOf(path_) + (WalBytes() > 0 ? "?mode=ro" : "?immutable=1");
    flags = SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_URI;
  }
  const int code = sqlite3_open_v2(name.c_str(), &connection_, flags, files_->name());
  if (code != SQLITE_OK) return FailWith(code);
  sqlite3_extended_result_codes(connection_, 1);
  // Another program may have written harmful triggers or a harmful schema into the file. Disable triggers, and
  // statements that could corrupt the file.
  sqlite3_db_config(connection_, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(connection_, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, nullptr);
  sqlite3_progress_handler(connection_, kStepsBetweenLooks, OnSteps, this);
  sqlite3_busy_timeout(connection_, kBusyTimeout_ms);
  // In exclusive mode WAL needs no shared memory. A custom VFS may not support shared memory, and a full disk has no
  // room for it.
  if (!vfs.empty() || access_ != Access::kShared) return Execute("PRAGMA locking_mode=EXCLUSIVE");
  return {};
}

Result<void> Database::Configure(std::uint64_t bytes_max) {
  if (access_ == Access::kReadOnly) return Execute("PRAGMA trusted_schema=OFF; PRAGMA temp_store=MEMORY;");
  std::uint64_t log_pages = kLogPagesMax;
  std::uint64_t log_bytes = kLogBytesKept;
  // On a small disk, limit the log to well below the size of the reserve, because the space of the reserve must suffice
  // for the log.
  if (const std::optional<DiskSpace> space = GetDiskSpace()) {
    const std::uint64_t reserve = ReserveBytesFor(space->capacity_bytes);
    log_pages = std::clamp(reserve / 4 / kPageBytes, kLogPagesMin, kLogPagesMax);
    log_bytes = std::min(log_bytes, std::max(reserve, kLogPagesMin * kPageBytes));
  }
  // Debian's SQLite overwrites deleted data with zeros by default. secure_delete=FAST avoids these writes, which would
  // double the bytes written for a deletion and wear the flash.
  Result<void> done = Execute(
      "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA secure_delete=FAST;"
      "PRAGMA trusted_schema=OFF; PRAGMA temp_store=MEMORY; PRAGMA journal_size_limit=" +
      std::to_string(log_bytes) + "; PRAGMA wal_autocheckpoint=" + std::to_string(log_pages));
  if (done && bytes_max != 0) {
    const Result<std::int64_t> page_bytes = Number("PRAGMA page_size");
    if (!page_bytes) return tl::unexpected(page_bytes.error());
    done = Execute("PRAGMA max_page_count=" + std::to_string(bytes_max / *page_bytes + 1));
  }
  return done;
}

Result<std::string> Database::SetAside(const std::string& path, const std::string& vfs) {
  if (!vfs.empty()) {
    sqlite3_vfs* files = sqlite3_vfs_find(vfs.c_str());
    Check(files != nullptr, "a file system is registered before it is used");
    for (const char* ending : {"", "-wal"}) (void)files->xDelete(files, (path + ending).c_str(), /*syncDir=*/1);
    return path;
  }
  const Result<std::string> aside = FreeAsidePath(path);
  if (!aside) return aside;
  if (const Result<void> moved = MoveFile(path, *aside); !moved) return tl::unexpected(moved.error());
  std::error_code ignored;
  std::filesystem::remove(path + "-shm", ignored);  // Shared-memory index of the renamed file.
  return *aside;
}

std::string Database::LastSetAside(const std::string& path, const std::string& vfs) {
  if (!vfs.empty() || path == kInMemory) return "";
  for (int number = kDamagedMax; number > 0; --number) {
    std::error_code error;
    if (std::filesystem::exists(AsidePath(path, number), error)) return AsidePath(path, number);
  }
  return "";
}

Database::~Database() {
  for (auto& [sql, prepared] : statements_) {
    Check(!prepared.is_in_use, "no query outlives its database");
    sqlite3_finalize(prepared.statement);
  }
  if (connection_) sqlite3_close(connection_);
  if (lock_file_ >= 0) close(lock_file_);
}

// Locks PATH.lock. SQLite's own locks would let two agents write to one file in turn, and give two records the same
// number.
Result<void> Database::Lock() {
  if (path_ == kInMemory) return {};
  const std::string lock_path = path_ + ".lock";
  lock_file_ = open(lock_path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600);
  if (lock_file_ < 0 && errno == EROFS) {
    lock_file_ = open(lock_path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC);
    // On a read-only file system no process can write to the database, so no lock is needed.
    if (lock_file_ < 0) return {};
  }
  if (lock_file_ < 0) return Fail(ErrorCode::kInternal, "cannot create " + lock_path + ": " + std::strerror(errno));
  if (flock(lock_file_, LOCK_EX | LOCK_NB) != 0) {
    return Fail(ErrorCode::kUnavailable, "database " + path_ + " is in use by another process");
  }
  return {};
}

int Database::OnSteps(void* database) {
  Database& self = *static_cast<Database*>(database);
  self.steps_ += kStepsBetweenLooks;
  return self.steps_ > self.steps_max_ ? 1 : 0;
}

tl::unexpected<Error> Database::FailWith(int code) const {
  if (code == SQLITE_INTERRUPT) {
    return Fail(
        ErrorCode::kCorrupt,
        "database " + path_ +
            ": a statement was stopped because it did not end: another program changed the file; restore a backup");
  }
  const bool is_full = (code & 0xFF) == SQLITE_IOERR && connection_ != nullptr &&
                       (sqlite3_system_errno(connection_) == ENOSPC || sqlite3_system_errno(connection_) == EDQUOT);
  if (is_full) code = SQLITE_FULL;
  std::string text = sqlite3_errstr(code);
  // The connection's message is more specific, but may belong to another error. Use the message only if the codes are
  // equal.
  if (connection_ && (sqlite3_errcode(connection_) & 0xFF) == (code & 0xFF)) text = sqlite3_errmsg(connection_);
  return Fail(CodeOf(code), "database " + path_ + ": " + text);
}

Query Database::Prepare(const std::string& sql) {
  Query::Prepared& prepared = statements_[sql];
  Check(!prepared.is_in_use, "one statement has one use at a time");
  if (!prepared.statement) {
    const int code = sqlite3_prepare_v3(connection_, sql.c_str(), static_cast<int>(sql.size()),
                                        SQLITE_PREPARE_PERSISTENT, &prepared.statement, nullptr);
    if (code != SQLITE_OK) return Query(*this, nullptr, code);
  }
  prepared.is_in_use = true;
  return Query(*this, &prepared, SQLITE_OK);
}

Result<void> Database::Execute(const std::string& sql) {
  steps_ = 0;
  const int code = sqlite3_exec(connection_, sql.c_str(), nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return FailWith(code);
  return {};
}

Result<std::int64_t> Database::Number(const std::string& sql) {
  Query query = Prepare(sql);
  const Result<bool> row = query.Step();
  if (!row) return tl::unexpected(row.error());
  if (!*row) return Fail(ErrorCode::kNotFound, "database " + path_ + ": no row for: " + sql);
  return query.Integer(0);
}

Result<void> Database::QuickCheck() { return RunCheck("PRAGMA quick_check(1)"); }

Result<void> Database::FullCheck() { return RunCheck("PRAGMA integrity_check(1)"); }

Result<void> Database::RunCheck(const std::string& sql) {
  Query query = Prepare(sql);
  const Result<bool> row = query.Step();
  if (!row) return tl::unexpected(row.error());
  const std::string_view verdict = query.Bytes(0);
  if (verdict == "ok") return {};
  std::string line(verdict.substr(0, verdict.find('\n')));
  if (line.starts_with("***") && verdict.find('\n') != std::string_view::npos) {
    const std::string_view rest = verdict.substr(verdict.find('\n') + 1);
    line = rest.substr(0, rest.find('\n'));
  }
  return Fail(ErrorCode::kCorrupt, "database " + path_ + " is damaged: " + line);
}

void Database::LeaveAsItIs() { (void)sqlite3_db_config(connection_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr); }

std::uint64_t Database::WalBytes() const {
  if (is_on_system_) return FileBytes("-wal");
  sqlite3_file* log = nullptr;
  sqlite3_int64 bytes = 0;
  const bool is_read = sqlite3_file_control(connection_, "main", SQLITE_FCNTL_JOURNAL_POINTER, &log) == SQLITE_OK &&
                       log != nullptr && log->pMethods != nullptr && log->pMethods->xFileSize(log, &bytes) == SQLITE_OK;
  return is_read ? static_cast<std::uint64_t>(bytes) : 0;
}

std::uint64_t Database::FileBytes(const char* ending) const {
  if (path_ == kInMemory) return 0;
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path_ + ending, error);
  return error ? 0 : size;
}

bool Database::IsOnReadOnlyFileSystem() const { return is_on_system_ && IsReadOnly(path_); }

std::optional<DiskSpace> Database::GetDiskSpace() const {
  if (path_ == kInMemory) return std::nullopt;
  DiskSpace space;
  if (!is_on_system_) {
    const int code = sqlite3_file_control(connection_, "main", kDiskSpaceControl, &space);
    return code == SQLITE_OK ? std::optional(space) : std::nullopt;
  }
  struct statvfs status {};
  if (::statvfs(FolderOf(path_).c_str(), &status) != 0 || status.f_blocks == 0) return std::nullopt;
  space.free_bytes = std::uint64_t{status.f_bavail} * status.f_frsize;
  space.capacity_bytes = std::uint64_t{status.f_blocks} * status.f_frsize;
  return space;
}

Result<std::uint64_t> Database::FreePageBytes() {
  const Result<std::int64_t> pages = Number("PRAGMA freelist_count");
  if (!pages) return tl::unexpected(pages.error());
  const Result<std::int64_t> page_bytes = Number("PRAGMA page_size");
  if (!page_bytes) return tl::unexpected(page_bytes.error());
  return static_cast<std::uint64_t>(*pages * *page_bytes);
}

Result<void> Database::Checkpoint() {
  const int code = sqlite3_wal_checkpoint_v2(connection_, nullptr, SQLITE_CHECKPOINT_RESTART, nullptr, nullptr);
  if (code != SQLITE_OK) return FailWith(code);
  return {};
}

Result<void> Database::CheckInPlace() {
  if (!is_on_system_ || access_ == Access::kReadOnly) return {};
  const std::uint64_t bytes_before = file_bytes_;
  if (const Result<void> there = CheckFile("", file_, file_bytes_); !there) return there;
  if (file_bytes_ < bytes_before) {
    // Another program may have vacuumed the file. The file's first page then contains the new length.
    if (file_bytes_ < BytesByHeader()) {
      return NotInPlace(
          "", "was cut from " + std::to_string(bytes_before) + " to " + std::to_string(file_bytes_) + " bytes");
    }
  }
  std::uint64_t ignored = 0;
  return CheckFile("-wal", log_, ignored);
}

std::uint64_t Database::BytesByHeader() const {
  constexpr sqlite3_int64 kPageSizeAt = 16;
  constexpr sqlite3_int64 kPageCountAt = 28;
  // Use SQLite's own handle. Closing another handle of the same file would release SQLite's locks on the file.
  sqlite3_file* file = nullptr;
  unsigned char size[2] = {};
  unsigned char count[4] = {};
  const bool is_read = sqlite3_file_control(connection_, "main", SQLITE_FCNTL_FILE_POINTER, &file) == SQLITE_OK &&
                       file != nullptr && file->pMethods->xRead(file, size, sizeof size, kPageSizeAt) == SQLITE_OK &&
                       file->pMethods->xRead(file, count, sizeof count, kPageCountAt) == SQLITE_OK;
  if (!is_read) return UINT64_MAX;
  const std::uint64_t page_bytes = size[0] * 256u + size[1];
  const std::uint64_t pages = (count[0] * 256u + count[1]) * 65536u + count[2] * 256u + count[3];
  return pages * (page_bytes == 1 ? 65536 : page_bytes);
}

Result<void> Database::CheckFile(const char* ending, std::optional<FileIdentity>& opened, std::uint64_t& bytes) {
  struct stat status {};
  if (::stat((path_ + ending).c_str(), &status) != 0) {
    // SQLite creates the log after opening the file, so the log may be missing at first. Other errors of stat do not
    // show whether the file is in place.
    if (!opened || (errno != ENOENT && errno != ENOTDIR)) return {};
    return NotInPlace(ending, "was removed or moved");
  }
  if (!opened) opened = FileIdentity{status.st_dev, status.st_ino};
  bytes = static_cast<std::uint64_t>(status.st_size);
  if (opened->device == status.st_dev && opened->inode == status.st_ino) return {};
  return NotInPlace(ending, "was replaced by another file");
}

tl::unexpected<Error> Database::NotInPlace(const char* ending, const std::string& what) {
  // Another file may now be at this path. Closing this database must not delete that file's log.
  LeaveAsItIs();
  return Fail(ErrorCode::kCorrupt, (*ending == 0 ? "database " : "the log of a database, ") + path_ + ending + ", " +
                                       what +
                                       " while this agent had it open, so new records would be lost. Put the file "
                                       "back and restart the agent, or start it without the file: peers send "
                                       "their records to an empty store");
}

Result<std::uint64_t> Database::UsedPageBytes() {
  const Result<std::int64_t> pages = Number("PRAGMA page_count");
  if (!pages) return tl::unexpected(pages.error());
  const Result<std::int64_t> page_bytes = Number("PRAGMA page_size");
  if (!page_bytes) return tl::unexpected(page_bytes.error());
  const Result<std::uint64_t> free_bytes = FreePageBytes();
  if (!free_bytes) return free_bytes;
  return static_cast<std::uint64_t>(*pages * *page_bytes) - *free_bytes;
}

std::uint64_t Database::WrittenBytes() const { return files_->written_bytes(); }

Result<void> Database::SetDurability(Durability durability) {
  if (durability == durability_) return {};
  const bool is_full = durability == Durability::kFull;
  const Result<void> done = Execute(is_full ? "PRAGMA synchronous=FULL" : "PRAGMA synchronous=NORMAL");
  if (done) durability_ = durability;
  return done;
}

Result<Transaction> Transaction::Begin(Database& database, Database::Durability durability) {
  if (const Result<void> set = database.SetDurability(durability); !set) return tl::unexpected(set.error());
  // With IMMEDIATE, the transaction fails at its beginning, and not at a later statement, if another process writes.
  const Result<void> begun = database.Prepare("BEGIN IMMEDIATE").Run();
  if (!begun) return tl::unexpected(begun.error());
  return Transaction(database);
}

Transaction::~Transaction() {
  if (!database_) return;
  // SQLite may already have rolled back after a full disk or an I/O error.
  if (sqlite3_get_autocommit(database_->connection_) == 0) (void)database_->Prepare("ROLLBACK").Run();
}

Result<void> Transaction::Commit() {
  // Check before the commit: the commit may move the log into a truncated file and so lengthen the file, which would
  // hide the truncation. Check again after the commit, for the returned result.
  if (const Result<void> there = database_->CheckInPlace(); !there) return there;
  const Result<void> committed = database_->Prepare("COMMIT").Run();
  if (!committed) return committed;
  return std::exchange(database_, nullptr)->CheckInPlace();
}

}  // namespace moondb
