#include "actors/storage/row_audit.h"

#include <algorithm>

#include "model/record_hash.h"
#include "model/record_key.h"

namespace moondb {

Result<RowAudit> RowAudit::Read(Database& database, const HaveLedger& ledger, const History& history,
                                const SharingRules& rules) {
  RowAudit audit;
  for (const RecordTable& table : RecordTables()) {
    if (const Result<void> read = audit.ReadTable(database, table); !read) return tl::unexpected(read.error());
  }
  if (const Result<void> read = audit.ReadHistory(database, history); !read) return tl::unexpected(read.error());
  audit.TakeDropped(ledger.have(), rules);
  audit.is_ledger_sound_ = ledger.is_sound() && audit.have_ == ledger.have();
  return audit;
}

Result<void> RowAudit::ReadTable(Database& database, const RecordTable& table) {
  Query query = table.ReadAfter(database, 0);
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return {};
    const std::uint64_t row_id = query.Unsigned(0);
    row_id_max_ = std::max(row_id_max_, row_id);
    const proto::StoredRecord record = table.Read(query);
    const RecordKey key = FromProto(record.key());
    if (key.seq == 0) continue;  // A local row. No peer has a copy.
    if (HashRecord(key, record.content()) == record.hash() && key.seq <= kSeqMax) {
      have_[key.stream].held.Add(key.seq);
    } else {
      damaged_rows_.emplace_back(&table, row_id);
      gone_.emplace(key.stream.origin, key.stream.type);
    }
  }
}

Result<void> RowAudit::ReadHistory(Database& database, const History& history) {
  Result<std::vector<History::Found>> damaged = history.FindDamaged(database);
  if (!damaged) return tl::unexpected(damaged.error());
  damaged_history_ = *std::move(damaged);
  const Result<std::uint64_t> row_id_max = history.MaxRowId(database);
  if (!row_id_max) return tl::unexpected(row_id_max.error());
  row_id_max_ = std::max(row_id_max_, *row_id_max);
  return {};
}

void RowAudit::TakeDropped(const HaveSet& in_file, const SharingRules& rules) {
  for (const auto& [stream, have] : in_file.streams()) {
    if (!have.held.Minus(have_.Get(stream).held).is_empty()) gone_.emplace(stream.origin, stream.type);
  }
  for (const auto& [stream, have] : in_file.streams()) {
    // A lost row may have superseded a record that a peer still holds. Forget the dropped seqs of such types, so that
    // the peer sends this record again. Types under the policy `all` have no superseded records: their dropped seqs are
    // pruned records and stay dropped.
    const bool may_be_replaced = rules.PolicyOf(stream.type) != proto::POLICY_ALL;
    if (may_be_replaced && gone_.contains({stream.origin, stream.type})) continue;
    const IntervalSet dropped = have.dropped.Minus(have_.Get(stream).held);
    if (!dropped.is_empty()) have_[stream].dropped = dropped;
  }
}

Result<void> RowAudit::Repair(Database& database, HaveLedger& ledger) const {
  for (const auto& [table, row_id] : damaged_rows_) {
    if (const Result<void> done = table->Delete(database, row_id); !done) return done;
  }
  for (const History::Found& found : damaged_history_) {
    Query query = database.Prepare("DELETE FROM history WHERE data_type = ? AND row_id = ?");
    query << found.type << found.row_id;
    if (const Result<void> done = query.Run(); !done) return done;
  }
  return ledger.Replace(database, have_);
}

std::vector<std::string> RowAudit::Findings() const {
  std::vector<std::string> findings;
  if (!damaged_history_.empty()) {
    findings.push_back(std::to_string(damaged_history_.size()) +
                       " superseded states in the store's history were damaged and removed; no other agent has them");
  }
  if (!is_ledger_sound_ || !damaged_rows_.empty()) {
    findings.push_back("the store was damaged: " + std::to_string(damaged_rows_.size()) + " records were wrong" +
                       (is_ledger_sound_ ? "" : ", and its have-set was wrong") +
                       "; other agents are asked for the missing records, and records that none of them has are lost");
  }
  return findings;
}

}  // namespace moondb
