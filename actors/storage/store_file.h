// Queries and copies a store's file for people, while the agent that owns it continues to use it.
//
// The file is opened read-only. SQLite's write-ahead log gives each call one consistent snapshot. Errors of all calls:
// kNotFound (no such file), kCorrupt (damaged, or not a database), kInternal (anything else: I/O, permissions).
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
  bool is_cut = false;  // There are more rows than were requested.
};

// Runs one SELECT, or a PRAGMA that only reads. kInvalid: wrong SQL, SQL that changes anything, or more than one
// statement. kFull: a row or the answer exceeds kQueryBytesMax. `stop_requested` is polled; if it returns true, the
// query ends with kTimedOut. While a query runs, the agent's write-ahead log only grows: SQLite cannot reuse it.
Result<QueryAnswer> QueryStore(const std::filesystem::path& file, const std::string& sql, std::size_t rows_max,
                               StopRequested stop_requested = {});

inline constexpr std::size_t kQueryBytesMax = 64 * 1024 * 1024;

// Makes a complete copy, even while the agent writes. Durable on return. The copy does not contain the store's
// incarnation (own_epochs.h). An agent that uses the copy as its store starts a new incarnation. Otherwise peers would
// assume that the copy knew later changes of the original store. kInvalid: `to` exists already. kFull: the disk is
// full. kInternal: `file` is not a store.
Result<void> BackUpStore(const std::filesystem::path& file, const std::filesystem::path& to);

}  // namespace moondb
