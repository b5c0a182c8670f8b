// History: this agent's own states that newer states have superseded under the policy `latest`. TeamConfig.keep in the
// team file sets how long states are kept. The history answers questions after the mission, such as how cold the night
// was.
//
// Rows of the history are in no have-set, are never sent to peers, and are lost with the disk. Other agents' records
// are never kept here. A superseded record moves here in the transaction that stores its successor.
//
// A row keeps its row id, so the order of row ids is the order of storing. Rows are clustered by type. A transaction
// that adds rows also removes the oldest rows of any type until the limit `bytes_max` holds. Trim enforces age limits,
// and a `bytes_max` that was lowered, some rows at a time.
//
// Counts and sizes are also kept in memory. As in HaveLedger, changes go to a draft, which Keep applies and Forget
// discards. For one thread at a time.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "actors/storage/record_tables.h"
#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "model/keep_rule.h"
#include "proto/retention.pb.h"
#include "proto/storage.pb.h"

namespace moondb {

inline constexpr std::size_t kHistoryTrimRowsMax = 2000;  // Maximum number of rows per call of Trim or Prune.

class History {
 public:
  struct Rules {
    // Rules of the types under `latest`. Rows of other types are not added, but existing rows of other types stay.
    std::map<DataType, KeepRule> keep;
    std::uint64_t bytes_max = 0;  // Limit of the size of all rows (Sum::bytes); 0: keep no rows.
  };
  struct Sum {
    std::uint64_t count = 0;
    std::uint64_t bytes = 0;  // Approximate size of the rows in the file, in bytes.
  };

  // `self` is the origin of all rows.
  History(AgentId self, Rules rules) : self_(self), rules_(std::move(rules)) {}

  // Computes counts and sizes from the table. Scans the table, but not the overflow pages of long contents. Also finds
  // the rows that `have` does not count as dropped. Such rows exist after a repair of the have-set, and peers may send
  // the records of these rows again.
  Result<void> Load(Database& database, const HaveSet& have);
  Sum sum() const { return SumOf(types_); }  // Number and size of all rows, as of the last commit.

  // A row whose content does not match its hash. FindDamaged returns all such rows. It reads all contents.
  struct Found {
    DataType type = 0;
    std::uint64_t row_id = 0;
  };
  Result<std::vector<Found>> FindDamaged(Database& database) const;
  // Returns the highest row id, or 0 if there are no rows.
  Result<std::uint64_t> MaxRowId(Database& database) const;

  // Inside the caller's transaction: copies a row that is about to be deleted from `table`, if the rules keep it.
  // Requires: the row's origin is `self`.
  Result<void> Take(Database& database, const RecordTable& table, const RecordTable::Row& row);
  // Inside the caller's transaction: removes the row of `key`, because the record is stored again. Does nothing if the
  // history has no such row.
  Result<void> Remove(Database& database, const RecordKey& key);
  // Inside the caller's transaction: removes the oldest rows until at least `bytes` bytes are freed or no rows are
  // left. Returns the number of bytes freed.
  Result<std::uint64_t> Drop(Database& database, std::uint64_t bytes);
  // Inside the caller's transaction: removes rows that are older than their type's rule allows, and the oldest rows
  // while the history exceeds bytes_max. Removes at most kHistoryTrimRowsMax rows. Returns true if more rows may have
  // to be removed. If `utc_now_ns` is null (this agent does not know the time), no row is removed by age. A row whose
  // timestamp comes from a suspect clock is not removed by age either, unless its type keeps no rows at all.
  Result<bool> Trim(Database& database, std::optional<std::int64_t> utc_now_ns);
  bool NeedsTrim() const;  // Returns false if Trim would find nothing to remove.
  // Inside the caller's transaction: removes the rows that an operator's request with `is_history` selects. A dry run
  // removes nothing.
  Result<proto::PruneReply> Prune(Database& database, const proto::PruneRequest& request, std::int64_t utc_now_ns);
  // Applies the changes of a transaction to the counts and sizes in memory. Call after the commit.
  void Keep();
  // Discards the changes to counts and sizes by an earlier transaction that failed. Call before a transaction.
  void Forget() { draft_.reset(); }

  // Returns one page of the history, with the same limits as ReadPage (actors/storage/record_pages.h). Logs and skips
  // damaged rows.
  Result<proto::ReadReply> Read(Database& database, const proto::ReadRequest& request) const;

 private:
  struct OfType {
    Sum sum;
    std::uint64_t oldest_row_id = 0;
    std::uint64_t seen_row_id = 0;  // Rows up to this id have timestamps of a suspect clock; Trim by age skips them.
  };
  using Types = std::map<DataType, OfType>;

  static Sum SumOf(const Types& types);
  // Returns the approximate bytes of a row in the file; null if there is no such row.
  static Result<std::optional<std::uint64_t>> FindBytes(Database& database, DataType type, std::uint64_t row_id);
  const Types& Now() const { return draft_ ? *draft_ : types_; }
  Types& Draft();
  KeepRule RuleOf(DataType type) const;
  Result<void> Delete(Database& database, DataType type, std::uint64_t row_id, std::uint64_t bytes);
  // Removes the oldest row of all types and returns its bytes. Requires: there is at least one row.
  Result<std::uint64_t> DropOldest(Database& database);
  Result<void> DropOlder(Database& database, DataType type, std::optional<std::int64_t> timestamp_before_ns,
                         std::size_t& rows_left);

  const AgentId self_;
  const Rules rules_;
  Types types_;
  std::optional<Types> draft_;
  std::map<RecordKey, std::uint64_t> not_dropped_;  // Row ids of the rows that Load's `have` did not count as dropped.
};

}  // namespace moondb
