// History: what this agent's own robot recorded under the policy `latest` and has superseded since, for as long as the
// team file says (TeamConfig.keep), in the table `history` and, as sums, in memory.
//
// `share: latest` decides what travels; this decides what stays on the robot's own disk, for whoever asks after the
// mission how cold the night was. It is outside all else that storage does: in no have-set, never sent, not verified
// against what is held, not counted as records, not seen by the query that looks for what a record supersedes. It is
// lost with its disk. A superseded record moves here in the transaction that stores its superseder; what other agents
// recorded never does.
//
// A row keeps the row id that it had, so history is in the order of storing. Rows are clustered by type: a page of one
// type, its oldest row and its rows of a certain age are found without looking at others'. The bound `bytes_max` holds
// when a transaction ends: the oldest rows of all types make room for what moves in, about as many bytes as come.
// Limits of age, and a bound that became lower, are the business of Trim, some rows at a time.
//
// As with HaveLedger, changes go to a draft of the sums; Keep or Forget follow the transaction's end. From one thread.
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

inline constexpr std::size_t kHistoryTrimRowsMax = 2000;  // Of one call of Trim or Prune.

class History {
 public:
  struct Rules {
    // Of the types under `latest`; of others nothing comes, and what is there stays.
    std::map<DataType, KeepRule> keep;
    std::uint64_t bytes_max = 0;  // Of the rows, as Sum::bytes counts them; 0: none is kept.
  };
  struct Sum {
    std::uint64_t count = 0;
    std::uint64_t bytes = 0;  // About what they take in the file.
  };

  // `self` is the origin of all rows.
  History(AgentId self, Rules rules) : self_(self), rules_(std::move(rules)) {}

  // Reads the sums from the table, without reading long contents, and which rows `have` does not count as dropped: a
  // repaired have-set no longer knows what the damaged rows had superseded, so peers may send these records again.
  Result<void> Load(Database& database, const HaveSet& have);
  Sum sum() const { return SumOf(types_); }  // As committed.

  // Rows whose content is not what their hash says; reads all of it.
  struct Found {
    DataType type = 0;
    std::uint64_t row_id = 0;
  };
  Result<std::vector<Found>> FindDamaged(Database& database) const;
  // The highest row id; 0: there is no row.
  Result<std::uint64_t> MaxRowId(Database& database) const;

  // Inside the caller's transaction: copies a row of `table`, which is of `self`, that is about to be deleted there.
  Result<void> Take(Database& database, const RecordTable& table, const RecordTable::Row& row);
  // Inside the caller's transaction: removes the row of `key`, if there is one, since the record is stored again.
  Result<void> Remove(Database& database, const RecordKey& key);
  // In the caller's transaction: removes the oldest rows until at least so many bytes are freed, or all are gone; how
  // many were freed.
  Result<std::uint64_t> Drop(Database& database, std::uint64_t bytes);
  // In the caller's transaction: removes rows that are older than their type's rule allows or beyond bytes_max,
  // kHistoryTrimRowsMax at most; true where there may be more. `utc_now_ns`: none where this agent cannot tell the
  // time, and no row goes by its age. Nor does one whose stamp comes from a suspect clock, unless its type keeps
  // nothing.
  Result<bool> Trim(Database& database, std::optional<std::int64_t> utc_now_ns);
  bool NeedsTrim() const;  // Else Trim would find nothing to do.
  // In the caller's transaction, for an operator: `request.is_history`. Where it is a dry run nothing is removed.
  Result<proto::PruneReply> Prune(Database& database, const proto::PruneRequest& request, std::int64_t utc_now_ns);
  // After a transaction's commit.
  void Keep();
  // Before the next transaction: what the last one drafted and did not commit.
  void Forget() { draft_.reset(); }

  // A page of it, as ReadPage (actors/storage/record_pages.h) has them. A damaged row is logged and left out.
  Result<proto::ReadReply> Read(Database& database, const proto::ReadRequest& request) const;

 private:
  struct OfType {
    Sum sum;
    std::uint64_t oldest_row_id = 0;
    std::uint64_t seen_row_id = 0;  // Up to it Trim need not look again: of unknown age. In memory alone.
  };
  using Types = std::map<DataType, OfType>;

  static Sum SumOf(const Types& types);
  // The bytes that a row counts for; none: there is no such row.
  static Result<std::optional<std::uint64_t>> FindBytes(Database& database, DataType type, std::uint64_t row_id);
  const Types& Now() const { return draft_ ? *draft_ : types_; }
  Types& Draft();
  KeepRule RuleOf(DataType type) const;
  Result<void> Delete(Database& database, DataType type, std::uint64_t row_id, std::uint64_t bytes);
  // Of all types, which hold at least one; its bytes.
  Result<std::uint64_t> DropOldest(Database& database);
  Result<void> DropOlder(Database& database, DataType type, std::optional<std::int64_t> timestamp_before_ns,
                         std::size_t& rows_left);

  const AgentId self_;
  const Rules rules_;
  Types types_;
  std::optional<Types> draft_;
  std::map<RecordKey, std::uint64_t> not_dropped_;  // Row ids of records that were not counted as dropped at Load.
};

}  // namespace moondb
