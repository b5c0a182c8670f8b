// A store's file as a person reads and copies it, beside the agent that owns it and without holding that one up.
//
// The file is opened for reading alone; SQLite's write-ahead log gives each call one consistent state. Errors of every
// call: kNotFound (no such file), kCorrupt (damaged, or not a database), kInternal (anything else: I/O, permissions).
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
  std::string text;  // A number as SQLite writes it, a text as it is, of a blob its bytes in hexadecimal.
};

struct QueryAnswer {
  std::vector<std::string> columns;
  std::vector<std::vector<QueryCell>> rows;
  bool is_cut = false;  // There are more rows than were asked for.
};

// One SELECT (or PRAGMA that asks). kInvalid: SQL that is wrong, that changes anything, or more than one statement;
// kFull: a row or the answer is larger than kQueryBytesMax.
// `stop_requested` is polled; true ends it with kTimedOut. While a query runs the agent's write-ahead log cannot begin
// anew.
Result<QueryAnswer> QueryStore(const std::filesystem::path& file, const std::string& sql, std::size_t rows_max,
                               StopRequested stop_requested = {});

inline constexpr std::size_t kQueryBytesMax = 64 * 1024 * 1024;

// A copy that is whole, even while the agent writes; durable when this returns. The copy is without the store's
// incarnation (own_epochs.h): put back as an agent's store it begins another, so that what the store has become since
// is not taken for what the copy knew. kInvalid: `to` is there already; kFull: the disk is; kInternal: `file` is no
// store.
Result<void> BackUpStore(const std::filesystem::path& file, const std::filesystem::path& to);

}  // namespace moondb
