#include "actors/storage/store_file.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstring>
#include <memory>
#include <utility>

#include "actors/storage/own_epochs.h"
#include "model/file_writing.h"

namespace moondb {

namespace {

constexpr int kFileBusyTimeout_ms = 5000;
// Steps of SQLite's virtual machine between two calls of stop_requested.
constexpr int kFileStepsBetweenLooks = 10'000;

struct Close {
  void operator()(sqlite3* connection) const { sqlite3_close_v2(connection); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using Connection = std::unique_ptr<sqlite3, Close>;
using Statement = std::unique_ptr<sqlite3_stmt, Close>;

tl::unexpected<Error> FailWith(int code, sqlite3* connection, const std::filesystem::path& file) {
  ErrorCode error = ErrorCode::kInternal;
  if ((code & 0xFF) == SQLITE_CORRUPT || (code & 0xFF) == SQLITE_NOTADB) error = ErrorCode::kCorrupt;
  if ((code & 0xFF) == SQLITE_FULL) error = ErrorCode::kFull;
  const char* text = connection != nullptr ? sqlite3_errmsg(connection) : sqlite3_errstr(code);
  return Fail(error, text, file.string());
}

Result<Connection> Open(const std::filesystem::path& file, int flags) {
  sqlite3* opened = nullptr;
  const int code = sqlite3_open_v2(file.c_str(), &opened, flags | SQLITE_OPEN_NOMUTEX, nullptr);
  Connection connection(opened);
  if (code != SQLITE_OK) return FailWith(code, opened, file);
  sqlite3_busy_timeout(opened, kFileBusyTimeout_ms);
  return connection;
}

Result<Connection> OpenToRead(const std::filesystem::path& file) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    return Fail(ErrorCode::kNotFound, "there is no such file", file.string());
  }
  Result<Connection> connection = Open(file, SQLITE_OPEN_READONLY);
  if (!connection) return connection;
  sqlite3_limit(connection->get(), SQLITE_LIMIT_ATTACHED, 0);
  sqlite3_limit(connection->get(), SQLITE_LIMIT_LENGTH, static_cast<int>(kQueryBytesMax));
  return connection;
}

std::string Hex(const unsigned char* bytes, int count) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  for (int i = 0; i < count; ++i) {
    text += kDigits[bytes[i] >> 4];
    text += kDigits[bytes[i] & 15];
  }
  return text;
}

QueryCell CellOf(sqlite3_stmt* statement, int column) {
  const int type = sqlite3_column_type(statement, column);
  if (type == SQLITE_NULL) return {};
  if (type == SQLITE_BLOB) {
    const auto* bytes = static_cast<const unsigned char*>(sqlite3_column_blob(statement, column));
    return {QueryCell::Kind::kBlob, Hex(bytes, sqlite3_column_bytes(statement, column))};
  }
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(statement, column));
  const auto size = static_cast<std::size_t>(sqlite3_column_bytes(statement, column));
  return {type == SQLITE_TEXT ? QueryCell::Kind::kText : QueryCell::Kind::kNumber,
          text == nullptr ? std::string() : std::string(text, size)};
}

int IsStopped(void* stop_requested) { return (*static_cast<const StopRequested*>(stop_requested))() ? 1 : 0; }

bool IsBlank(const char* sql) { return std::string_view(sql).find_first_not_of(" \t\r\n;") == std::string_view::npos; }

Result<Statement> Prepare(sqlite3* connection, const std::string& sql, const std::filesystem::path& file) {
  sqlite3_stmt* prepared = nullptr;
  const char* tail = nullptr;
  const int code = sqlite3_prepare_v2(connection, sql.c_str(), static_cast<int>(sql.size() + 1), &prepared, &tail);
  Statement statement(prepared);
  if ((code & 0xFF) == SQLITE_ERROR) return Fail(ErrorCode::kInvalid, sqlite3_errmsg(connection), "query");
  if (code != SQLITE_OK) return FailWith(code, connection, file);
  if (prepared == nullptr) return Fail(ErrorCode::kInvalid, "holds no statement", "query");
  if (!IsBlank(tail)) return Fail(ErrorCode::kInvalid, "holds more than one statement", "query");
  if (sqlite3_stmt_readonly(prepared) == 0 || sqlite3_column_count(prepared) == 0) {
    return Fail(ErrorCode::kInvalid, "is not a query: only SELECT statements are run", "query");
  }
  return statement;
}

bool SyncToDisk(const std::filesystem::path& file_or_folder) {
  const int descriptor = open(file_or_folder.c_str(), O_RDONLY | O_CLOEXEC);
  const bool is_durable = descriptor >= 0 && fsync(descriptor) == 0;
  if (descriptor >= 0) close(descriptor);
  return is_durable;
}

Result<void> ForgetIncarnation(sqlite3* copy, const std::filesystem::path& to) {
  const int code = sqlite3_exec(copy, kForgetIncarnationSql, nullptr, nullptr, nullptr);
  if (code != SQLITE_OK) return FailWith(code, copy, to);
  return {};
}

// Renames the finished copy `part` to `to`, so that a file named `to` is always complete. Fails if `to` exists.
Result<void> Publish(const std::filesystem::path& part, const std::filesystem::path& to) {
  const std::filesystem::path folder = to.has_parent_path() ? to.parent_path() : ".";
  std::string why = "the disk does not accept the data";
  if (SyncToDisk(part)) {
    const std::error_code failure = MoveToNew(part, to);
    if (!failure && SyncToDisk(folder)) return {};
    if (failure) why = failure.message();
  }
  return Fail(ErrorCode::kInternal, "cannot be written: " + why, to.string());
}

}  // namespace

Result<QueryAnswer> QueryStore(const std::filesystem::path& file, const std::string& sql, std::size_t rows_max,
                               StopRequested stop_requested) {
  const Result<Connection> connection = OpenToRead(file);
  if (!connection) return tl::unexpected(connection.error());
  if (stop_requested) sqlite3_progress_handler(connection->get(), kFileStepsBetweenLooks, IsStopped, &stop_requested);
  const Result<Statement> statement = Prepare(connection->get(), sql, file);
  if (!statement) return tl::unexpected(statement.error());
  QueryAnswer answer;
  const int columns = sqlite3_column_count(statement->get());
  for (int i = 0; i < columns; ++i) answer.columns.emplace_back(sqlite3_column_name(statement->get(), i));
  std::size_t bytes = 0;
  while (true) {
    const int code = sqlite3_step(statement->get());
    if (code == SQLITE_DONE) return answer;
    if (code == SQLITE_INTERRUPT) return Fail(ErrorCode::kTimedOut, "takes too long; ask for less", "query");
    if (code == SQLITE_TOOBIG) return Fail(ErrorCode::kFull, "a value is too large", "query");
    if (code != SQLITE_ROW) return FailWith(code, connection->get(), file);
    if (answer.rows.size() == rows_max) {
      answer.is_cut = true;
      return answer;
    }
    std::vector<QueryCell>& row = answer.rows.emplace_back();
    for (int i = 0; i < columns; ++i) {
      bytes += sizeof(QueryCell) + row.emplace_back(CellOf(statement->get(), i)).text.size();
    }
    if (bytes > kQueryBytesMax) return Fail(ErrorCode::kFull, "the answer is too large; ask for less", "query");
  }
}

Result<void> BackUpStore(const std::filesystem::path& file, const std::filesystem::path& to) {
  std::error_code error;
  if (std::filesystem::exists(to, error)) {
    return Fail(ErrorCode::kInvalid, "already exists; a backup never overwrites a file", to.string());
  }
  const std::filesystem::path folder = std::filesystem::absolute(to).parent_path();
  if (!std::filesystem::is_directory(folder, error)) {
    return Fail(ErrorCode::kNotFound, "there is no folder " + folder.string(), to.string());
  }
  const Result<Connection> source = OpenToRead(file);
  if (!source) return tl::unexpected(source.error());
  const std::filesystem::path part = to.string() + ".part-" + std::to_string(getpid());
  // A copy must be as private as the store. SQLite would create the file with the permissions of the umask.
  const int created = open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, S_IRUSR | S_IWUSR);
  if (created < 0) {
    return Fail(ErrorCode::kInternal, std::string("cannot be written: ") + std::strerror(errno), to.string());
  }
  close(created);
  Result<Connection> copy = Open(part, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
  if (!copy) {
    std::filesystem::remove(part, error);
    return tl::unexpected(copy.error());
  }
  sqlite3_backup* backup = sqlite3_backup_init(copy->get(), "main", source->get(), "main");
  int code = backup == nullptr ? sqlite3_errcode(copy->get()) : sqlite3_backup_step(backup, -1);
  if (backup != nullptr) (void)sqlite3_backup_finish(backup);
  Result<void> done;
  const bool is_damaged = code == SQLITE_CORRUPT || code == SQLITE_NOTADB;
  if (code != SQLITE_DONE) done = FailWith(code, nullptr, is_damaged ? file : to);
  // The agent continues to write to its store. Peers must not take a restored copy for the store with these later
  // records.
  if (done) done = ForgetIncarnation(copy->get(), to);
  copy->reset();
  if (done) done = Publish(part, to);
  if (!done) std::filesystem::remove(part, error);
  return done;
}

int SqliteVersion() { return sqlite3_libversion_number(); }

}  // namespace moondb
