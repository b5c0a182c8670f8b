#include "actors/storage/verify.h"

#include "actors/storage/have_ledger.h"
#include "actors/storage/record_pages.h"
#include "actors/storage/record_tables.h"
#include "actors/storage/record_validator.h"
#include "actors/storage/schema.h"
#include "model/record_hash.h"

namespace moondb {

namespace {

// Largest seq of an interval. Greater seqs occur only in a damaged have-set.
constexpr std::uint64_t kSeqOfIntervalMax = UINT64_MAX - 1;

IntervalSet Behind(const IntervalSet& seqs, std::uint64_t seq) {
  if (seq > kSeqOfIntervalMax) return {};
  IntervalSet before;
  if (seq > 0) before.Add({1, seq});
  return seqs.Minus(before);
}

IntervalSet UpTo(const IntervalSet& seqs, std::uint64_t seq) { return seqs.Minus(Behind(seqs, seq)); }

void AddFinding(const proto::RecordKey& key, const std::string& text, proto::VerifyReply& reply) {
  if (reply.findings_size() >= kVerifyFindingsMax) return;
  proto::VerifyFinding& finding = *reply.add_findings();
  *finding.mutable_key() = key;
  finding.set_text(text);
}

Result<void> CheckHaveSet(Database& database, const HaveSet& have) {
  HaveLedger on_disk;
  if (const Result<void> loaded = on_disk.Load(database); !loaded) return loaded;
  if (on_disk.is_sound() && on_disk.have() == have) return {};
  return Fail(ErrorCode::kCorrupt, "database " + database.path() + " is damaged: its have-set");
}

Result<proto::VerifyReply> VerifyFile(Database& database, const HaveSet& have) {
  Result<void> checked = CheckSchema(database);
  if (checked) checked = database.QuickCheck();
  if (checked) checked = CheckHaveSet(database, have);
  if (!checked && checked.error().code != ErrorCode::kCorrupt) return tl::unexpected(checked.error());
  proto::VerifyReply reply;
  if (!checked) reply.add_findings()->set_text(checked.error().text);
  reply.set_is_complete(true);
  return reply;
}

Result<proto::VerifyReply> VerifyRows(Database& database, const HaveSet& have, std::uint64_t after_row_id) {
  proto::ReadRequest request;
  request.set_after_row_id(after_row_id);
  request.set_records_max(kVerifyRecordsMax);
  request.set_content_bytes_max(kVerifyBytesMax);
  const Result<proto::ReadReply> page = ReadPage(database, request);
  if (!page) return tl::unexpected(page.error());
  proto::VerifyReply reply;
  for (const proto::StoredRecord& record : page->records()) {
    const RecordKey key = FromProto(record.key());
    if (HashRecord(key, record.content()) != record.hash()) {
      reply.set_damaged_count(reply.damaged_count() + 1);
      AddFinding(record.key(), "its content does not match its hash", reply);
    }
    if (key.seq != 0 && !have.Get(key.stream).held.Contains(key.seq)) {
      reply.set_orphaned_count(reply.orphaned_count() + 1);
      AddFinding(record.key(), "a row exists, but the have-set does not list it", reply);
    }
  }
  reply.set_checked_count(page->records_size());
  reply.set_is_complete(page->is_complete());
  reply.set_last_row_id(page->row_ids().empty() ? after_row_id : *page->row_ids().rbegin());
  return reply;
}

void AddMissing(const StreamKey& stream, const IntervalSet& missing, proto::VerifyReply& reply) {
  reply.set_missing_count(reply.missing_count() + static_cast<double>(missing.Count()));
  for (const IntervalSet::Interval& interval : missing.intervals()) {
    for (std::uint64_t seq = interval.first; seq <= interval.last; ++seq) {
      if (reply.findings_size() >= kVerifyFindingsMax) return;
      AddFinding(ToProto(RecordKey{stream, seq}), "the have-set lists it, but no row exists", reply);
    }
  }
}

// The seqs of the rows that FindRows read. FindRows reads the first `rows_max` rows of a stream whose seq is greater
// than `after`.
struct SeqsWithRows {
  IntervalSet seqs;
  std::uint64_t last_seq = kSeqOfIntervalMax;  // All rows up to this seq were read.
};

Result<SeqsWithRows> FindRows(Database& database, const StreamKey& stream, std::uint64_t after,
                              std::uint32_t rows_max) {
  SeqsWithRows found;
  const RecordTable* table = FindRecordTable(stream.type);
  if (table == nullptr || after >= kSeqMax) return found;
  Query query = table->ReadInterval(database, stream, after + 1, kSeqMax, /*agent=*/0);
  for (std::uint32_t count = 0; count < rows_max; ++count) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) return found;
    found.seqs.Add(query.Unsigned(3));
  }
  found.last_seq = found.seqs.Max();
  return found;
}

Result<proto::VerifyReply> VerifyHeld(Database& database, const HaveSet& have, const RecordKey& after) {
  proto::VerifyReply reply;
  std::uint32_t looked_at = 0;  // Number of rows and streams read so far.
  for (auto it = have.streams().lower_bound(after.stream); it != have.streams().end(); ++it) {
    const auto& [stream, in_stream] = *it;
    const std::uint64_t after_seq = stream == after.stream ? after.seq : 0;
    const IntervalSet held = Behind(in_stream.held, after_seq);
    if (held.is_empty()) continue;
    const Result<SeqsWithRows> found = FindRows(database, stream, after_seq, kVerifyRecordsMax - looked_at);
    if (!found) return tl::unexpected(found.error());
    const IntervalSet expected = UpTo(held, found->last_seq);
    reply.set_checked_count(reply.checked_count() + static_cast<double>(expected.Count()));
    AddMissing(stream, expected.Minus(found->seqs), reply);
    looked_at += static_cast<std::uint32_t>(found->seqs.Count()) + 1;
    *reply.mutable_last_key() = ToProto(RecordKey{stream, found->last_seq});
    if (looked_at >= kVerifyRecordsMax) return reply;
  }
  reply.set_is_complete(true);
  return reply;
}

// Parses the stream and the seqs of a request.
Result<HaveSet> ReadStream(const proto::FingerprintRequest& request) {
  proto::HaveSet single;
  *single.add_streams() = request.stream();
  single.mutable_streams(0)->clear_dropped();
  if (FindRecordTable(request.stream().data_type()) == nullptr) {
    return Fail(ErrorCode::kInvalid, "is unknown to this agent", "stream.data_type");
  }
  return FromProto(single);
}

}  // namespace

Result<proto::VerifyReply> Verify(Database& database, const HaveSet& have, const proto::VerifyRequest& request) {
  switch (request.part()) {
    case proto::VERIFY_PART_FILE:
      return VerifyFile(database, have);
    case proto::VERIFY_PART_ROWS:
      return VerifyRows(database, have, request.after_row_id());
    case proto::VERIFY_PART_HELD:
      return VerifyHeld(database, have, FromProto(request.after_key()));
    default:
      return Fail(ErrorCode::kInvalid, "is unknown to this agent", "part");
  }
}

Result<proto::FingerprintReply> TakeFingerprint(Database& database, const proto::FingerprintRequest& request) {
  const Result<HaveSet> asked = ReadStream(request);
  if (!asked) return tl::unexpected(asked.error());
  const auto& [stream, seqs] = *asked->streams().begin();
  const RecordTable& table = *FindRecordTable(stream.type);
  proto::FingerprintReply reply;
  std::uint32_t looked_at = 0;  // Number of rows and intervals read so far.
  std::size_t bytes = 0;
  const auto is_full = [&] { return looked_at >= kVerifyRecordsMax || bytes >= kVerifyBytesMax; };
  for (const IntervalSet::Interval& interval : seqs.held.intervals()) {
    if (is_full()) return reply;
    Query query = table.ReadInterval(database, stream, interval.first, interval.last, /*agent=*/0);
    while (true) {
      const Result<bool> row = query.Step();
      if (!row) return tl::unexpected(row.error());
      if (!*row) break;
      if (is_full()) return reply;
      const proto::StoredRecord record = table.Read(query);
      reply.set_fingerprint(reply.fingerprint() ^ HashRecord(FromProto(record.key()), record.content()));
      reply.set_record_count(reply.record_count() + 1);
      reply.set_last_seq(record.key().seq());
      bytes += record.content().size();
      ++looked_at;
    }
    reply.set_last_seq(interval.last);
    ++looked_at;
  }
  reply.set_is_complete(true);
  return reply;
}

}  // namespace moondb
