// RowAudit: a store's rows read through at the start, and what has to be mended then.
//
// SQLite's own check sees a broken tree, not a changed byte. A row whose hash is right is there, whatever the have-set
// in the file says; one whose hash is wrong is not, and is removed, so that peers send its record again.
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
  // Reads all rows of records and of `history`, beside the have-set that `ledger` has loaded. Fails as Database does.
  static Result<RowAudit> Read(Database& database, const HaveLedger& ledger, const History& history,
                               const SharingRules& rules);

  // Nothing has to be mended.
  bool is_sound() const { return is_ledger_sound_ && damaged_rows_.empty() && damaged_history_.empty(); }
  std::uint64_t row_id_max() const { return row_id_max_; }  // 0: there is no row.
  // What the sound rows hold, and what the have-set says was dropped.
  const HaveSet& have() const { return have_; }

  // Inside the caller's transaction: removes what is damaged and lets the have-set be have(); HaveLedger::Keep follows
  // the commit.
  Result<void> Repair(Database& database, HaveLedger& ledger) const;

  // One sentence for each kind of damage, for the event log.
  std::vector<std::string> Findings() const;

 private:
  Result<void> ReadTable(Database& database, const RecordTable& table);
  Result<void> ReadHistory(Database& database, const History& history);
  void TakeDropped(const HaveSet& in_file, const SharingRules& rules);

  HaveSet have_;
  std::uint64_t row_id_max_ = 0;
  bool is_ledger_sound_ = true;
  std::vector<std::pair<const RecordTable*, std::uint64_t>> damaged_rows_;  // By row id.
  std::vector<History::Found> damaged_history_;
  std::set<std::pair<AgentId, DataType>> gone_;  // Whose rows are not all there.
};

}  // namespace moondb
