// Queries and copies a store's file for people, while the agent that owns the file continues to use it.
//
// The file is opened read-only. SQLite's write-ahead log gives each call one consistent snapshot. All calls fail with
// kNotFound if there is no such file, with kCorrupt if the file is damaged or not a database, and with kInternal for
// other reasons (I/O, permissions).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

using StopRequested = std::function<bool()>;

struct QueryCell {
  enum class Kind { kNull, kNumber, kText, kBlob };
  Kind kind = Kind::kNull;
  // Numbers as SQLite formats them, text unchanged, blobs in hexadecimal.
  std::string text;
};

struct QueryAnswer {
  std::vector<std::string> columns;
  std::vector<std::vector<QueryCell>> rows;
  // True if there are more rows than were requested.
  bool is_cut = false;
};

// Runs one SELECT, or a PRAGMA that only reads. `stop_requested` is polled; if it returns true, the query ends with
// kTimedOut. While a query runs, the agent's write-ahead log only grows: SQLite cannot reuse the log. Fails with
// kInvalid for wrong SQL, SQL that changes anything, or more than one statement. Fails with kFull if a row or the
// answer exceeds kQueryBytesMax.
Result<QueryAnswer> QueryStore(const std::filesystem::path& file, const std::string& sql, std::size_t rows_max,
                               StopRequested stop_requested = {});

inline constexpr std::size_t kQueryBytesMax = 64 * 1024 * 1024;

// Makes a complete copy, even while the agent writes. Durable on return. The copy does not contain the store's
// incarnation (own_epochs.h), so an agent that uses the copy as its store starts a new incarnation. Otherwise peers
// would assume that the copy knew later changes of the original store. Fails with kInvalid if `to` exists, with kFull
// if the disk is full, and with kInternal if `file` is not a store.
Result<void> BackUpStore(const std::filesystem::path& file, const std::filesystem::path& to);

// Returns the version of the SQLite library that this program uses: 3040001 for 3.40.1.
int SqliteVersion();

}  // namespace moondb
