// RowAudit: reads all rows of a store when the process starts, and repairs damage.
//
// SQLite's own check detects a broken B-tree, but not a changed byte. A row with a correct hash counts as held, even if
// the have-set in the file does not contain it. A row with a wrong hash is removed, so peers send its record again.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "actors/storage/have_ledger.h"
#include "actors/storage/history.h"
#include "actors/storage/record_tables.h"
#include "actors/storage/sharing_rules.h"
#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"

namespace moondb {

class RowAudit {
 public:
  // Reads all rows of records and of `history`. `ledger` must have loaded the have-set. Fails as Database does.
  static Result<RowAudit> Read(Database& database, const HaveLedger& ledger, const History& history,
                               const SharingRules& rules);

  // Returns true if nothing needs repair.
  bool is_sound() const { return is_ledger_sound_ && damaged_rows_.empty() && damaged_history_.empty(); }
  std::uint64_t row_id_max() const { return row_id_max_; }  // 0 if there are no rows.
  // The repaired have-set: the seqs of the undamaged rows, and the dropped seqs of the file's have-set that remain
  // valid.
  const HaveSet& have() const { return have_; }

  // Inside the caller's transaction: removes damaged rows and stores have() as the have-set. Call HaveLedger::Keep
  // after the commit.
  Result<void> Repair(Database& database, HaveLedger& ledger) const;

  // Returns one sentence for each kind of damage, for the event log.
  std::vector<std::string> Findings() const;

 private:
  Result<void> ReadTable(Database& database, const RecordTable& table);
  Result<void> ReadHistory(Database& database, const History& history);
  void TakeDropped(const HaveSet& in_file, const SharingRules& rules);

  HaveSet have_;
  std::uint64_t row_id_max_ = 0;
  bool is_ledger_sound_ = true;
  std::vector<std::pair<const RecordTable*, std::uint64_t>> damaged_rows_;  // Table and row id of each damaged row.
  std::vector<History::Found> damaged_history_;
  std::set<std::pair<AgentId, DataType>> gone_;  // Origins and types that have lost rows.
};

}  // namespace moondb
