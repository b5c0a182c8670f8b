#include "actors/storage/record_store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "actors/storage/bundle_shelf.h"
#include "actors/storage/prune.h"
#include "actors/storage/record_door.h"
#include "actors/storage/record_pages.h"
#include "actors/storage/role_history.h"
#include "actors/storage/schema.h"
#include "actors/storage/verify.h"
#include "model/check.h"
#include "model/record_check.h"

namespace moondb {

namespace {

constexpr std::size_t kRejectionsKept = 8;
constexpr int kEpochRandomBits = 48;
// 16384 lives of this agent that a lost disk knew of; who claims more would use up the epochs that are left.
constexpr std::uint64_t kOwnEpochJumpMax = 1ull << (kEpochRandomBits + 14);
constexpr std::uint64_t kRowIdMax = std::uint64_t{1} << 62;
constexpr int kInsertRecordsMax = 65536;

// A robot that repeats a record may find its agent's clock judged otherwise by then.
std::string OtherwiseMarked(proto::Record record) {
  record.set_is_clock_suspect(!record.is_clock_suspect());
  return SerializeRecord(record);
}

// The origin's own order of its records.
std::pair<std::uint64_t, std::uint64_t> OrderOf(const RecordKey& key) { return {key.stream.epoch, key.seq}; }

}  // namespace

// Row numbers and have-set changes of one transaction become the store's only when it is committed.
class RecordStore::Writing {
 public:
  static Result<Writing> Begin(RecordStore& store) {
    Result<Transaction> transaction = Transaction::Begin(*store.database_);
    if (!transaction) return tl::unexpected(transaction.error());
    store.ledger_.Forget();
    return Writing(store, *std::move(transaction));
  }

  std::uint64_t epoch = 0;  // Of own records.

  Result<void> InsertRow(const RecordKey& key, const proto::Record& record, const std::string& content,
                         std::uint64_t hash) {
    const RecordTable& table = *FindRecordTable(key.stream.type);
    const Result<void> done = table.Insert(*store_.database_, next_row_id_, key, record, content, hash);
    if (!done) return done;
    ++next_row_id_;
    types_.insert(key.stream.type);
    if (key.stream.type == proto::LOCAL_TRAVERSABILITY_MAP) map_bytes_ += content.size();
    if (key.seq != 0) store_.ledger_.AddHeld(key.stream, key.seq);
    return {};
  }

  Result<void> DeleteRow(const RecordTable& table, const RecordTable::Row& row) {
    if (row.key.seq != 0) store_.ledger_.AddDropped(row.key.stream, {row.key.seq, row.key.seq});
    if (row.key.stream.type == proto::LOCAL_TRAVERSABILITY_MAP) map_bytes_ -= row.content_bytes;
    return table.Delete(*store_.database_, row.row_id);
  }

  Result<void> Commit(proto::RecordsStored& stored) {
    if (const Result<void> done = store_.ledger_.Write(*store_.database_); !done) return done;
    if (next_row_id_ != store_.next_row_id_) {
      if (const Result<void> done = store_.WriteNextRowId(next_row_id_); !done) return done;
    }
    if (const Result<void> done = transaction_.Commit(); !done) return done;
    store_.ledger_.Keep();
    if (next_row_id_ != store_.next_row_id_) stored.set_last_row_id(next_row_id_ - 1);
    for (const DataType type : types_) stored.add_data_types(type);
    store_.next_row_id_ = next_row_id_;
    store_.map_bytes_ = map_bytes_;
    if (epoch != 0) store_.epoch_ = epoch;
    store_.own_epoch_highest_ = std::max(store_.own_epoch_highest_, store_.epoch_);
    return {};
  }

 private:
  Writing(RecordStore& store, Transaction transaction)
      : epoch(store.epoch_),
        store_(store),
        transaction_(std::move(transaction)),
        next_row_id_(store.next_row_id_),
        map_bytes_(store.map_bytes_) {}

  RecordStore& store_;
  Transaction transaction_;
  std::uint64_t next_row_id_;
  std::uint64_t map_bytes_;
  std::set<DataType> types_;
};

Result<std::unique_ptr<RecordStore>> RecordStore::Open(Options options) {
  Check(options.team.count(options.self) == 1, "a store's agent is in its team");
  Result<std::unique_ptr<RecordStore>> store = OpenFile(options);
  // Of a file that was checked before others read on from its rows, and may miss them: only a new process begins anew.
  if (store || store.error().code != ErrorCode::kCorrupt || options.is_checked) return store;
  const Result<std::string> aside = Database::SetAside(options.path, options.vfs);
  if (!aside) return tl::unexpected(aside.error());
  spdlog::error("storage: {}; it is set aside as {}, and an empty one begun", ToString(store.error()), *aside);
  store = OpenFile(options);
  if (store) (*store)->set_aside_ = *aside;
  return store;
}

Result<std::unique_ptr<RecordStore>> RecordStore::OpenFile(const Options& options) {
  Result<std::unique_ptr<Database>> database = Database::Open(options.path, options.bytes_max, options.vfs);
  if (!database) return tl::unexpected(database.error());
  std::unique_ptr<RecordStore> store(new RecordStore(options, *std::move(database)));
  const Result<void> loaded = store->Load();
  if (loaded) return store;
  if (loaded.error().code == ErrorCode::kCorrupt) store->database_->LeaveAsItIs();
  return tl::unexpected(loaded.error());
}

Result<void> RecordStore::Load() {
  if (!options_.is_checked) {
    if (const Result<void> checked = CheckSchema(*database_); !checked) return checked;
    if (const Result<void> checked = database_->QuickCheck(); !checked) return checked;
  }
  if (const Result<void> migrated = Migrate(*database_); !migrated) return migrated;
  if (const Result<void> checked = CheckOwner(); !checked) return checked;
  if (const Result<void> loaded = ledger_.Load(*database_); !loaded) return loaded;
  for (const auto& [stream, have] : ledger_.have().streams()) NoteOwnEpoch(stream);  // Of rows, too, that are damaged.
  if (const Result<void> loaded = peer_log_.Load(*database_); !loaded) return loaded;
  const Result<std::int64_t> next_row_id = database_->Number("SELECT value FROM meta WHERE name = 'next_row_id'");
  if (!next_row_id) return tl::unexpected(next_row_id.error());
  next_row_id_ = static_cast<std::uint64_t>(*next_row_id);
  if (const Result<void> loaded = write_count_.Load(*database_); !loaded) return loaded;
  if (!options_.is_checked) {
    if (const Result<void> mended = MendFromRows(); !mended) return mended;
  } else if (!ledger_.is_sound()) {
    return Fail(ErrorCode::kCorrupt, "database " + database_->path() + " is damaged: its have-set");
  }
  const Result<std::uint64_t> map_bytes = FindRecordTable(proto::LOCAL_TRAVERSABILITY_MAP)->SumContentBytes(*database_);
  if (!map_bytes) return tl::unexpected(map_bytes.error());
  map_bytes_ = *map_bytes;
  return {};
}

// SQLite's own check sees a broken tree, not a changed byte. A row whose hash is right is there, whatever the ledger
// says; one whose hash is wrong is not.
Result<void> RecordStore::MendFromRows() {
  HaveSet mended;
  std::uint64_t row_id_max = 0;
  std::vector<std::pair<const RecordTable*, std::uint64_t>> damaged;  // Row ids.
  std::set<std::pair<AgentId, DataType>> gone;                        // Whose rows are not all there.
  for (const RecordTable& table : RecordTables()) {
    Query query = table.ReadAfter(*database_, 0);
    while (true) {
      const Result<bool> row = query.Step();
      if (!row) return tl::unexpected(row.error());
      if (!*row) break;
      const std::uint64_t row_id = query.Unsigned(0);
      row_id_max = std::max(row_id_max, row_id);
      const proto::StoredRecord record = table.Read(query);
      const RecordKey key = FromProto(record.key());
      if (key.seq == 0) continue;  // Nobody else has it.
      if (HashRecord(key, record.content()) == record.hash() && key.seq <= kSeqMax) {
        mended[key.stream].held.Add(key.seq);
      } else {
        damaged.emplace_back(&table, row_id);
        gone.emplace(key.stream.origin, key.stream.type);
      }
    }
  }
  for (const auto& [stream, have] : ledger_.have().streams()) {
    if (!have.held.Minus(mended.Get(stream).held).is_empty()) gone.emplace(stream.origin, stream.type);
  }
  for (const auto& [stream, have] : ledger_.have().streams()) {
    // What a lost row had replaced may be the newest that is left with a peer, which is to send it. Under `all` nothing
    // is replaced: what was dropped was pruned.
    const bool may_be_replaced = rules_.PolicyOf(stream.type) != proto::POLICY_ALL;
    if (may_be_replaced && gone.contains({stream.origin, stream.type})) continue;
    const IntervalSet dropped = have.dropped.Minus(mended.Get(stream).held);
    if (!dropped.is_empty()) mended[stream].dropped = dropped;
  }
  const bool is_row_id_sound = next_row_id_ > row_id_max && next_row_id_ <= kRowIdMax;
  if (!is_row_id_sound) next_row_id_ = row_id_max + 1;
  const bool is_ledger_sound = ledger_.is_sound() && mended == ledger_.have();
  if (is_ledger_sound && damaged.empty() && is_row_id_sound) return {};

  Result<Transaction> transaction = Transaction::Begin(*database_);
  if (!transaction) return tl::unexpected(transaction.error());
  for (const auto& [table, row_id] : damaged) {
    if (const Result<void> done = table->Delete(*database_, row_id); !done) return done;
  }
  if (const Result<void> done = ledger_.Replace(*database_, mended); !done) return done;
  if (const Result<void> done = WriteNextRowId(next_row_id_); !done) return done;
  if (const Result<void> done = transaction->Commit(); !done) return done;
  ledger_.Keep();
  for (const auto& [stream, have] : mended.streams()) NoteOwnEpoch(stream);
  spdlog::error(
      "storage: {} was damaged within: {} records were wrong, and its have-set {}; peers will be asked for what it "
      "lacks",
      database_->path(), damaged.size(), is_ledger_sound ? "right" : "too");
  return {};
}

Result<void> RecordStore::WriteNextRowId(std::uint64_t row_id) {
  Query query = database_->Prepare("UPDATE meta SET value = ? WHERE name = 'next_row_id'");
  query << row_id;
  return query.Run();
}

// Two agents numbering in one copied file would give two records one name.
Result<void> RecordStore::CheckOwner() {
  Result<Transaction> transaction = Transaction::Begin(*database_);
  if (!transaction) return tl::unexpected(transaction.error());
  const Result<std::int64_t> owner = database_->Number("SELECT value FROM meta WHERE name = 'own_agent'");
  if (!owner && owner.error().code != ErrorCode::kNotFound) return tl::unexpected(owner.error());
  if (owner && *owner != options_.self) {
    return Fail(ErrorCode::kRefused, "database " + database_->path() + " belongs to agent " + std::to_string(*owner) +
                                         ", not to agent " + std::to_string(options_.self));
  }
  std::string sql = "INSERT OR IGNORE INTO meta VALUES('own_agent', " + std::to_string(options_.self) + ");";
  sql += "DELETE FROM team_agent;";
  for (const AgentId agent : options_.team) sql += "INSERT INTO team_agent VALUES(" + std::to_string(agent) + ");";
  sql += "DELETE FROM custom_type;";
  if (const Result<void> done = database_->Execute(sql); !done) return done;
  for (const proto::CustomType& type : options_.custom_types) {
    Query query = database_->Prepare("INSERT INTO custom_type VALUES(?, ?)");
    query << type.id() << std::string_view(type.name());
    if (const Result<void> done = query.Run(); !done) return done;
  }
  return transaction->Commit();
}

Result<void> RecordStore::CheckOwnRecord(const proto::Record& record) const {
  const Result<void> checked = CheckOwnership(record, options_.self, options_.team);
  return checked && record.has_custom() ? CheckDeclared(record.custom(), options_.custom_types) : checked;
}

void RecordStore::NoteOwnEpoch(const StreamKey& stream) {
  if (stream.origin != options_.self) return;
  own_epoch_highest_ = std::max(own_epoch_highest_, stream.epoch);
  // New records under a lower epoch would count as older than those that peers already have.
  if (epoch_ < own_epoch_highest_) epoch_ = 0;
}

// Of what a peer says that it has; what cannot be is passed over and counted.
void RecordStore::NoteOwnEpochs(const proto::HaveSet& have) {
  for (const proto::StreamHave& claimed : have.streams()) {
    const StreamKey stream{claimed.origin_agent(), claimed.epoch(), claimed.data_type()};
    if (IsPossible(stream)) {
      NoteOwnEpoch(stream);
    } else {
      ++rejected_count_;
    }
  }
}

bool RecordStore::IsPossible(const StreamKey& stream) const {
  return stream.origin != options_.self || stream.epoch <= own_epoch_highest_ ||
         stream.epoch - own_epoch_highest_ <= kOwnEpochJumpMax;
}

Result<std::uint64_t> RecordStore::NextEpoch() {
  const std::uint64_t counter = own_epoch_highest_ >> kEpochRandomBits;
  const std::uint64_t random = random_() >> (64 - kEpochRandomBits);
  if (counter < 0xFFFF) return ((counter + 1) << kEpochRandomBits) | random;
  // The counter is used up: go on above the highest epoch, by random steps.
  const std::uint64_t left = UINT64_MAX - own_epoch_highest_;
  if (left == 0) return Fail(ErrorCode::kInternal, "no epochs are left for this agent's records");
  return own_epoch_highest_ + 1 + random_() % std::min<std::uint64_t>(left, 0xFFFF'FFFF);
}

Result<void> RecordStore::CheckInsert(const proto::InsertRequest& request) const {
  if (request.records_size() > kInsertRecordsMax) {
    return Fail(ErrorCode::kInvalid, "more than " + std::to_string(kInsertRecordsMax) + " records", "records");
  }
  for (int i = 0; i < request.records_size(); ++i) {
    Result<void> checked = CheckOwnRecord(request.records(i));
    if (checked && request.is_local() && request.records(i).has_map_quarantine()) {
      checked =
          Fail(ErrorCode::kInvalid, "holds for the whole team or not at all: it cannot be local", "map_quarantine");
    }
    if (checked) continue;
    const std::string place = "records[" + std::to_string(i) + "]";
    return Fail(checked.error().code, checked.error().text,
                checked.error().field.empty() ? place : place + "." + checked.error().field);
  }
  return {};
}

Result<void> RecordStore::CheckRoomForMaps(const proto::InsertRequest& request) {
  if (options_.map_store_bytes_max == 0) return {};
  const bool has_map = std::any_of(request.records().begin(), request.records().end(),
                                   [](const proto::Record& record) { return record.has_local_traversability_map(); });
  if (!has_map) return {};
  const Result<std::uint64_t> used = UsedByRecords();
  if (!used) return tl::unexpected(used.error());
  if (*used < options_.map_store_bytes_max) return {};
  return Fail(ErrorCode::kFull, "the store's budget (retention.store_mb_max) is used up: no more maps are taken, and " +
                                    std::string("what is left of the disk is for states"));
}

// Bundles, whose number is bounded, push no records out.
Result<std::uint64_t> RecordStore::UsedByRecords() {
  const Result<std::uint64_t> used = database_->UsedPageBytes();
  if (!used) return used;
  const Result<std::int64_t> bundles = database_->Number("SELECT coalesce(sum(length(file)), 0) FROM downlink_bundle");
  if (!bundles) return tl::unexpected(bundles.error());
  return *used - std::min(*used, static_cast<std::uint64_t>(*bundles));
}

RecordStore::Inserted RecordStore::Insert(const proto::InsertRequest& request) {
  Inserted result;
  Result<void> done = CheckInsert(request);
  if (done) done = CheckRoomForMaps(request);
  std::vector<std::string> contents;
  for (int i = 0; done && i < request.records_size(); ++i) {
    contents.push_back(SerializeRecord(request.records(i)));
    if (contents.back().size() <= kRecordContentBytesMax) continue;
    done = Fail(ErrorCode::kInvalid, "is longer than " + std::to_string(kRecordContentBytesMax) + " bytes",
                "records[" + std::to_string(i) + "]");
  }
  if (done && request.records_size() > 0) done = InsertAll(request, contents, result);
  if (!done) {
    result = Inserted();
    *result.reply.mutable_error() = ToProto(done.error());
  }
  return result;
}

Result<void> RecordStore::InsertAll(const proto::InsertRequest& request, const std::vector<std::string>& contents,
                                    Inserted& result) {
  Result<Writing> writing = Writing::Begin(*this);
  if (!writing) return tl::unexpected(writing.error());
  for (int i = 0; i < request.records_size(); ++i) {
    const Result<void> done =
        InsertOne(request.records(i), contents[i], request.is_local(), *writing, *result.reply.add_keys());
    if (done) continue;
    if (done.error().field.empty()) return done;
    return Fail(done.error().code, done.error().text, "records[" + std::to_string(i) + "]." + done.error().field);
  }
  return writing->Commit(result.stored);
}

Result<void> RecordStore::InsertOne(const proto::Record& record, const std::string& content, bool is_local,
                                    Writing& writing, proto::RecordKey& reply_key) {
  const DataType type = TypeOf(record);
  const RecordTable& table = *FindRecordTable(type);
  if (const std::string name = NaturalKey(record); !name.empty()) {
    const Result<std::optional<RecordTable::Named>> named =
        table.FindByNaturalKey(*database_, options_.self, type, name);
    if (!named) return tl::unexpected(named.error());
    const bool is_same = *named && ((*named)->content == content || (*named)->content == OtherwiseMarked(record));
    if (is_same && ((*named)->key.seq == 0) == is_local) {
      reply_key = ToProto((*named)->key);
      return {};
    }
    if (*named) {
      const char* as = !is_same ? "with other content" : is_local ? "and is shared" : "and is local";
      return Fail(ErrorCode::kInvalid, name + " already exists " + as, table.name());
    }
  }
  RecordKey key{StreamKey{options_.self, 0, type}, 0};
  if (!is_local) {
    if (writing.epoch == 0) {
      const Result<std::uint64_t> epoch = NextEpoch();
      if (!epoch) return tl::unexpected(epoch.error());
      writing.epoch = *epoch;
    }
    key.stream.epoch = writing.epoch;
    const StreamHave& had = ledger_.Get(key.stream);
    key.seq = std::max(had.held.Max(), had.dropped.Max()) + 1;
  }
  if (rules_.IsLatest(type)) {
    const Result<std::vector<RecordTable::Row>> olds =
        table.FindByLatestKey(*database_, options_.self, type, LatestKey(record));
    if (!olds) return tl::unexpected(olds.error());
    for (const RecordTable::Row& old : *olds) {
      // What stays on this agent cannot supersede what peers are owed.
      if (is_local && old.key.seq != 0) continue;
      if (const Result<void> done = writing.DeleteRow(table, old); !done) return done;
    }
  }
  reply_key = ToProto(key);
  return writing.InsertRow(key, record, content, HashRecord(key, content));
}

void RecordStore::Reject(Error error, Stored& result) {
  ++rejected_count_;
  result.reply.set_rejected_count(result.reply.rejected_count() + 1);
  if (result.rejections.size() < kRejectionsKept) result.rejections.push_back(std::move(error));
}

RecordStore::Stored RecordStore::Store(const proto::StoreRequest& request) {
  Stored result;
  std::vector<Opened> opened;
  std::set<StreamKey> touched;
  for (const proto::StoredRecord& stored : request.records()) {
    const RecordKey key = FromProto(stored.key());
    Result<proto::Record> record = OpenStored(stored, options_.team);
    const bool is_forged = key.stream.origin == options_.self && key.stream.epoch == epoch_ && epoch_ != 0 &&
                           key.seq > ledger_.have().Get(key.stream).Had().Max();
    if (record && is_forged) record = Fail(ErrorCode::kInvalid, "was never given by this agent", "key.seq");
    if (record && !IsPossible(key.stream)) record = Fail(ErrorCode::kInvalid, "is from the far future", "key.epoch");
    if (record) {
      touched.insert(key.stream);
      opened.push_back(Opened{key, *std::move(record), &stored});
    } else {
      Reject(Error{record.error().code, ToString(key) + ": " + record.error().text, record.error().field}, result);
    }
  }
  HaveSet dropped;
  for (const proto::StreamHave& stream : request.dropped()) {
    const Result<void> checked = CheckDropped(stream, dropped);
    if (!checked) Reject(checked.error(), result);
  }
  for (const auto& [stream, have] : dropped.streams()) touched.insert(stream);

  if (const Result<void> done = StoreAll(opened, dropped, result); !done) {
    result = Stored();
    *result.reply.mutable_error() = ToProto(done.error());
    return result;
  }
  HaveSet had;
  for (const StreamKey& stream : touched) {
    had[stream] = ledger_.have().Get(stream);
    NoteOwnEpoch(stream);
  }
  *result.reply.mutable_had() = ToProto(ForPeer(had));
  return result;
}

Result<void> RecordStore::StoreAll(const std::vector<Opened>& opened, const HaveSet& dropped, Stored& result) {
  if (opened.empty() && dropped.streams().empty()) return {};
  Result<Writing> writing = Writing::Begin(*this);
  if (!writing) return tl::unexpected(writing.error());
  for (const Opened& record : opened) {
    if (const Result<void> done = StoreOne(record, *writing, result); !done) return done;
  }
  for (const auto& [stream, have] : dropped.streams()) {
    if (const Result<void> done = ApplyDropped(stream, have.dropped, *writing); !done) return done;
  }
  return writing->Commit(result.stored);
}

Result<void> RecordStore::StoreOne(const Opened& opened, Writing& writing, Stored& result) {
  const RecordTable& table = *FindRecordTable(opened.key.stream.type);
  const StreamHave& have = ledger_.Get(opened.key.stream);
  if (have.dropped.Contains(opened.key.seq)) return {};
  if (have.held.Contains(opened.key.seq)) {
    const Result<std::optional<RecordTable::Row>> held = table.Find(*database_, opened.key);
    if (!held) return tl::unexpected(held.error());
    if (*held && (*held)->hash != opened.stored->hash()) {
      Reject(Error{ErrorCode::kInvalid, ToString(opened.key) + ": is held with other content", "hash"}, result);
    }
    return {};
  }
  if (rules_.IsLatest(opened.key.stream.type)) {
    const Result<std::vector<RecordTable::Row>> others =
        table.FindByLatestKey(*database_, opened.key.stream.origin, opened.key.stream.type, LatestKey(opened.record));
    if (!others) return tl::unexpected(others.error());
    const bool is_late = std::any_of(others->begin(), others->end(), [&opened](const RecordTable::Row& other) {
      return other.key.seq != 0 && OrderOf(other.key) > OrderOf(opened.key);
    });
    if (is_late) {
      ledger_.AddDropped(opened.key.stream, {opened.key.seq, opened.key.seq});
      return {};
    }
    for (const RecordTable::Row& other : *others) {
      if (other.key.seq == 0) continue;
      if (const Result<void> done = writing.DeleteRow(table, other); !done) return done;
    }
  }
  result.reply.set_stored_count(result.reply.stored_count() + 1);
  return writing.InsertRow(opened.key, opened.record, opened.stored->content(), opened.stored->hash());
}

Result<void> RecordStore::CheckDropped(const proto::StreamHave& dropped, HaveSet& accepted) const {
  proto::HaveSet single;
  *single.add_streams() = dropped;
  single.mutable_streams(0)->clear_held();
  const Result<HaveSet> read = FromProto(single);
  if (!read) return tl::unexpected(read.error());
  const StreamKey& stream = read->streams().begin()->first;
  const IntervalSet& seqs = read->streams().begin()->second.dropped;
  if (!options_.team.count(stream.origin))
    return Fail(ErrorCode::kInvalid, "is not in the team", "dropped.origin_agent");
  if (!rules_.MayBeDropped(stream.type)) {
    return Fail(ErrorCode::kInvalid, DataTypeName(stream.type) + " records are never dropped", "dropped.data_type");
  }
  if (stream.epoch == 0) return Fail(ErrorCode::kInvalid, "is missing", "dropped.epoch");
  if (!IsPossible(stream)) return Fail(ErrorCode::kInvalid, "is from the far future", "dropped.epoch");
  const bool is_present_own = stream.origin == options_.self && stream.epoch == epoch_;
  const std::uint64_t seq_max = is_present_own ? ledger_.have().Get(stream).Had().Max() : kSeqMax;
  if (seqs.Max() > seq_max) return Fail(ErrorCode::kInvalid, "names seqs that never were", "dropped.dropped");
  accepted[stream].dropped.Add(seqs);
  return {};
}

Result<bool> RecordStore::IsSuperseded(const RecordTable& table, const RecordTable::Row& row) {
  const Result<std::vector<RecordTable::Row>> others =
      table.FindByLatestKey(*database_, row.key.stream.origin, row.key.stream.type, row.latest_key);
  if (!others) return tl::unexpected(others.error());
  return std::any_of(others->begin(), others->end(), [&row](const RecordTable::Row& other) {
    return other.key.seq != 0 && OrderOf(other.key) > OrderOf(row.key);
  });
}

Result<void> RecordStore::ApplyDropped(const StreamKey& stream, const IntervalSet& dropped, Writing& writing) {
  const RecordTable& table = *FindRecordTable(stream.type);
  const IntervalSet held = ledger_.Get(stream).held;
  const IntervalSet never_held = dropped.Minus(held);
  IntervalSet superseded = never_held;
  const RecordKey newest = ledger_.NewestHeld(stream.origin, stream.type);
  if (newest.seq == 0 || newest.stream.epoch < stream.epoch) {
    superseded = IntervalSet();
  } else if (newest.stream.epoch == stream.epoch) {
    IntervalSet not_older;
    not_older.Add({newest.seq, kSeqMax});
    superseded = never_held.Minus(not_older);
  }
  for (const IntervalSet::Interval& interval : superseded.intervals()) ledger_.AddDropped(stream, interval);
  const IntervalSet held_and_dropped = dropped.Minus(never_held);
  for (const IntervalSet::Interval& interval : held_and_dropped.intervals()) {
    const Result<std::vector<RecordTable::Row>> rows =
        table.FindInInterval(*database_, stream, interval.first, interval.last);
    if (!rows) return tl::unexpected(rows.error());
    for (const RecordTable::Row& row : *rows) {
      const Result<bool> is_superseded = IsSuperseded(table, row);
      if (!is_superseded) return tl::unexpected(is_superseded.error());
      if (!*is_superseded) continue;
      if (const Result<void> done = writing.DeleteRow(table, row); !done) return done;
    }
  }
  return {};
}

HaveSet RecordStore::ForPeer(const HaveSet& have) const {
  HaveSet told;
  for (const auto& [stream, state] : have.streams()) {
    const bool is_pruned = !rules_.MayBeDropped(stream.type) && !state.dropped.is_empty();
    if (rules_.IsLatest(stream.type) || is_pruned) {
      told[stream].dropped = state.Had();
    } else {
      told[stream] = state;
    }
  }
  return told;
}

proto::HaveReply RecordStore::GetHave(const proto::HaveRequest& request) const {
  proto::HaveReply reply;
  *reply.mutable_have() = ToProto(request.is_for_peer() ? ForPeer(ledger_.have()) : ledger_.have());
  reply.set_epoch(epoch_);
  return reply;
}

Result<proto::MissingReply> RecordStore::GetMissing(const proto::MissingRequest& request) {
  NoteOwnEpochs(request.destination_have());
  return FindMissing(*database_, ledger_.have(), rules_, request);
}

Result<proto::ReadReply> RecordStore::Read(const proto::ReadRequest& request) { return ReadPage(*database_, request); }

Result<void> RecordStore::SaveRoles(const proto::RoleAssignment& roles) { return moondb::SaveRoles(*database_, roles); }

Result<proto::LoadRolesReply> RecordStore::LoadRoles() { return moondb::LoadRoles(*database_); }

Result<void> RecordStore::NotePeerHave(const proto::PeerHave& note) {
  NoteOwnEpochs(note.acknowledged());
  return peer_log_.Note(*database_, note);
}

Result<proto::StorageStatus> RecordStore::GetStatus(std::uint32_t day) {
  std::map<std::pair<AgentId, DataType>, std::uint64_t> counts;
  for (const auto& [stream, have] : ledger_.have().streams()) counts[{stream.origin, stream.type}] += have.held.Count();
  for (const RecordTable& table : RecordTables()) {
    const auto local = table.CountNotShared(*database_, options_.self);
    if (!local) return tl::unexpected(local.error());
    for (const auto& [type, count] : *local) counts[{options_.self, type}] += count;
  }
  proto::StorageStatus status;
  for (const auto& [key, count] : counts) {
    if (count == 0) continue;
    proto::RecordCount& added = *status.add_counts();
    added.set_origin_agent(key.first);
    added.set_data_type(key.second);
    added.set_count(static_cast<double>(count));
  }
  const Result<std::uint64_t> used = UsedByRecords();
  if (!used) return tl::unexpected(used.error());
  status.set_database_bytes(static_cast<double>(*used + database_->WalBytes()));
  status.set_disk_free_bytes(static_cast<double>(database_->DiskFreeBytes()));
  status.set_epoch(epoch_);
  status.set_rejected_count(static_cast<double>(rejected_count_));
  status.set_wal_bytes(static_cast<double>(database_->WalBytes()));
  status.set_map_bytes(static_cast<double>(map_bytes_));
  status.set_pruned_count(static_cast<double>(pruned_count_));
  for (const auto& [written_on, bytes] : write_count_.Days(*database_, day)) {
    proto::DayBytes& added = *status.add_written();
    added.set_day(written_on);
    added.set_bytes(static_cast<double>(bytes));
  }
  return status;
}

Result<proto::PruneReply> RecordStore::Prune(const proto::PruneRequest& request, std::int64_t utc_now_ns) {
  const Result<PruneChoice> choice = ChooseToPrune(*database_, ledger_.have(), rules_, request, utc_now_ns);
  if (!choice) return tl::unexpected(choice.error());
  if (!request.is_dry_run() && !choice->rows.empty()) {
    Result<Writing> writing = Writing::Begin(*this);
    if (!writing) return tl::unexpected(writing.error());
    for (const PruneChoice::Chosen& chosen : choice->rows) {
      if (const Result<void> done = writing->DeleteRow(*chosen.table, chosen.row); !done) {
        return tl::unexpected(done.error());
      }
    }
    proto::RecordsStored nothing;
    if (const Result<void> done = writing->Commit(nothing); !done) return tl::unexpected(done.error());
    pruned_count_ += choice->rows.size();
  }
  std::map<DataType, proto::PrunedType> by_type;
  for (const PruneChoice::Chosen& chosen : choice->rows) {
    proto::PrunedType& pruned = by_type[chosen.row.key.stream.type];
    pruned.set_record_count(pruned.record_count() + 1);
    pruned.set_content_bytes(pruned.content_bytes() + static_cast<double>(chosen.row.content_bytes));
  }
  proto::PruneReply reply;
  for (auto& [type, pruned] : by_type) {
    pruned.set_data_type(type);
    *reply.add_pruned() = std::move(pruned);
  }
  reply.set_unacknowledged_count(choice->unacknowledged_count);
  reply.set_is_complete(choice->is_complete);
  return reply;
}

Result<proto::VerifyReply> RecordStore::Verify(const proto::VerifyRequest& request) {
  return moondb::Verify(*database_, ledger_.have(), request);
}

Result<proto::FingerprintReply> RecordStore::TakeFingerprint(const proto::FingerprintRequest& request) {
  return moondb::TakeFingerprint(*database_, request);
}

Result<void> RecordStore::SaveBundle(const proto::SaveBundleRequest& request) {
  return moondb::SaveBundle(*database_, request);
}

Result<proto::LoadBundlesReply> RecordStore::LoadBundles() { return moondb::LoadBundles(*database_); }

Result<proto::ReadBundleReply> RecordStore::ReadBundle(const proto::ReadBundleRequest& request) {
  return ReadBundlePart(*database_, request);
}

Result<void> RecordStore::AcknowledgeBundle(std::uint32_t number) {
  return moondb::AcknowledgeBundle(*database_, number, ledger_.have());
}

}  // namespace moondb
