#include "actors/storage/sqlite_database.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "actors/storage/counting_files.h"
#include "model/check.h"

namespace moondb {

namespace {

constexpr char kInMemory[] = ":memory:";
constexpr int kBusyTimeoutMs = 2000;

ErrorCode CodeOf(int sqlite_code) {
  switch (sqlite_code & 0xFF) {
    case SQLITE_FULL:
      return ErrorCode::kFull;
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

void Query::Note(int code) {
  Check(code != SQLITE_RANGE && code != SQLITE_MISUSE, "a query binds the parameters that its SQL has");
  if (code_ == SQLITE_OK) code_ = code;
}

Query& Query::BindInteger(std::int64_t value) {
  if (prepared_) Note(sqlite3_bind_int64(prepared_->statement, ++parameter_, value));
  return *this;
}

Query& Query::operator<<(double value) {
  if (prepared_) Note(sqlite3_bind_double(prepared_->statement, ++parameter_, value));
  return *this;
}

Query& Query::operator<<(std::string_view text) {
  // A null pointer would bind NULL, also where the text is merely empty.
  const char* bytes = text.data() ? text.data() : "";
  if (prepared_) {
    Note(sqlite3_bind_text64(prepared_->statement, ++parameter_, bytes, text.size(), SQLITE_STATIC, SQLITE_UTF8));
  }
  return *this;
}

Query& Query::operator<<(Blob blob) {
  const char* bytes = blob.bytes.data() ? blob.bytes.data() : "";
  if (prepared_) {
    Note(sqlite3_bind_blob64(prepared_->statement, ++parameter_, bytes, blob.bytes.size(), SQLITE_STATIC));
  }
  return *this;
}

Query& Query::operator<<(std::nullptr_t) {
  if (prepared_) Note(sqlite3_bind_null(prepared_->statement, ++parameter_));
  return *this;
}

Result<bool> Query::Step() {
  if (code_ != SQLITE_OK) return database_->FailWith(code_);
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

bool Query::IsNull(int column) const { return sqlite3_column_type(prepared_->statement, column) == SQLITE_NULL; }

Database::Database(std::string path, const std::string& vfs)
    : path_(std::move(path)), files_(std::make_unique<CountingFiles>(vfs)) {}

Result<std::unique_ptr<Database>> Database::Open(const std::string& path, std::uint64_t bytes_max,
                                                 const std::string& vfs) {
  std::unique_ptr<Database> database(new Database(path, vfs));
  if (vfs.empty()) {
    if (const Result<void> locked = database->Lock(); !locked) return tl::unexpected(locked.error());
  }
  const int code =
      sqlite3_open_v2(path.c_str(), &database->connection_,
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, database->files_->name());
  if (code != SQLITE_OK) return database->FailWith(code);
  sqlite3_extended_result_codes(database->connection_, 1);
  sqlite3_busy_timeout(database->connection_, kBusyTimeoutMs);
  // Then WAL needs no shared memory, which other file systems need not have.
  if (!vfs.empty()) {
    if (const Result<void> done = database->Execute("PRAGMA locking_mode=EXCLUSIVE"); !done) {
      return tl::unexpected(done.error());
    }
  }
  // Debian's SQLite would write zeros over all that is deleted: as many bytes again, on flash that wears.
  Result<void> done = database->Execute(
      "PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA journal_size_limit=16777216; PRAGMA secure_delete=FAST;"
      "PRAGMA trusted_schema=OFF; PRAGMA temp_store=MEMORY;");
  if (done && bytes_max != 0) {
    const Result<std::int64_t> page_bytes = database->Number("PRAGMA page_size");
    if (!page_bytes) return tl::unexpected(page_bytes.error());
    done = database->Execute("PRAGMA max_page_count=" + std::to_string(bytes_max / *page_bytes + 1));
  }
  if (!done) return tl::unexpected(done.error());
  return database;
}

Result<std::string> Database::SetAside(const std::string& path, const std::string& vfs) {
  if (!vfs.empty()) {
    sqlite3_vfs* files = sqlite3_vfs_find(vfs.c_str());
    Check(files != nullptr, "a file system is registered before it is used");
    for (const char* ending : {"", "-wal"}) (void)files->xDelete(files, (path + ending).c_str(), /*syncDir=*/1);
    return path;
  }
  std::string aside;
  for (int number = 1; aside.empty(); ++number) {
    if (number > kDamagedMax) {
      return Fail(ErrorCode::kFull, "database " + path + " is damaged, and " + std::to_string(kDamagedMax) +
                                        " damaged ones lie beside it already: look at the disk");
    }
    const std::string candidate = path + ".damaged-" + std::to_string(number);
    if (!std::filesystem::exists(candidate)) aside = candidate;
  }
  // The log first: if this process ends in between, it must not be taken for a log of the next file.
  for (const char* ending : {"-wal", ""}) {
    std::error_code error;
    if (!std::filesystem::exists(path + ending, error)) continue;
    std::filesystem::rename(path + ending, aside + ending, error);
    if (error) return Fail(ErrorCode::kInternal, "cannot rename " + path + ending + ": " + error.message());
  }
  std::error_code ignored;
  std::filesystem::remove(path + "-shm", ignored);  // Of the file that is gone.
  return aside;
}

Database::~Database() {
  for (auto& [sql, prepared] : statements_) {
    Check(!prepared.is_in_use, "no query outlives its database");
    sqlite3_finalize(prepared.statement);
  }
  if (connection_) sqlite3_close(connection_);
  if (lock_file_ >= 0) close(lock_file_);
}

// SQLite's own locks would let two agents take turns on one file and number the same records twice.
Result<void> Database::Lock() {
  if (path_ == kInMemory) return {};
  const std::string lock_path = path_ + ".lock";
  lock_file_ = open(lock_path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (lock_file_ < 0) return Fail(ErrorCode::kInternal, "cannot create " + lock_path + ": " + std::strerror(errno));
  if (flock(lock_file_, LOCK_EX | LOCK_NB) != 0) {
    return Fail(ErrorCode::kUnavailable, "database " + path_ + " is in use by another process");
  }
  return {};
}

tl::unexpected<Error> Database::FailWith(int code) const {
  std::string text = sqlite3_errstr(code);
  // The connection's own words say more, unless they are about something else.
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

Result<void> Database::QuickCheck() {
  Query query = Prepare("PRAGMA quick_check(1)");
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

std::uint64_t Database::WalBytes() const { return FileBytes("-wal"); }

std::uint64_t Database::FileBytes(const char* ending) const {
  if (path_ == kInMemory) return 0;
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path_ + ending, error);
  return error ? 0 : size;
}

std::uint64_t Database::DiskFreeBytes() const {
  if (path_ == kInMemory) return 0;
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(path_, error);
  return error ? 0 : space.available;
}

Result<std::uint64_t> Database::UsedPageBytes() {
  const Result<std::int64_t> pages = Number("PRAGMA page_count");
  if (!pages) return tl::unexpected(pages.error());
  const Result<std::int64_t> free_pages = Number("PRAGMA freelist_count");
  if (!free_pages) return tl::unexpected(free_pages.error());
  const Result<std::int64_t> page_bytes = Number("PRAGMA page_size");
  if (!page_bytes) return tl::unexpected(page_bytes.error());
  return static_cast<std::uint64_t>((*pages - *free_pages) * *page_bytes);
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
  // IMMEDIATE: fail here if another process writes, not in the middle.
  const Result<void> begun = database.Prepare("BEGIN IMMEDIATE").Run();
  if (!begun) return tl::unexpected(begun.error());
  return Transaction(database);
}

Transaction::~Transaction() {
  if (!database_) return;
  // After a full disk or an I/O error SQLite may have rolled back by itself.
  if (sqlite3_get_autocommit(database_->connection_) == 0) (void)database_->Prepare("ROLLBACK").Run();
}

Result<void> Transaction::Commit() {
  const Result<void> committed = database_->Prepare("COMMIT").Run();
  if (committed) database_ = nullptr;
  return committed;
}

}  // namespace moondb
