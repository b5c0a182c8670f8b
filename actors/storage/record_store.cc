#include "actors/storage/record_store.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <optional>
#include <utility>

#include "actors/storage/bundle_shelf.h"
#include "actors/storage/disk_guard.h"
#include "actors/storage/log_check.h"
#include "actors/storage/map_budget.h"
#include "actors/storage/map_times.h"
#include "actors/storage/migration.h"
#include "actors/storage/prune.h"
#include "actors/storage/record_pages.h"
#include "actors/storage/record_validator.h"
#include "actors/storage/role_history.h"
#include "actors/storage/row_audit.h"
#include "actors/storage/schema.h"
#include "actors/storage/store_owner.h"
#include "actors/storage/verify.h"
#include "model/check.h"
#include "model/data_types.h"
#include "model/event.h"
#include "model/have_page.h"
#include "model/insert_check.h"
#include "model/record_authority.h"
#include "model/record_check.h"
#include "model/record_hash.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

constexpr std::size_t kRejectionsKept = 8;
constexpr std::uint64_t kRowIdMax = std::uint64_t{1} << 62;
constexpr int kInsertRecordsMax = 65536;
constexpr std::uint64_t kRowBytes = 100;  // Approximate bytes of a row in addition to its content.
// If the disk is full, at least this many bytes of history are removed to make room for a record.
constexpr std::uint64_t kRoomBytesMin = 256 * 1024;

// Returns whether `record` repeats the stored record. `content` is the serialised `record`. `is_clock_suspect` and
// `is_state` may differ, since the storing agent sets these two fields itself.
bool IsRepeated(const std::string& stored_content, const proto::Record& record, const std::string& content) {
  if (stored_content == content) return true;
  proto::Record stored;
  if (!stored.ParseFromString(stored_content)) return false;
  stored.set_is_clock_suspect(record.is_clock_suspect());
  stored.set_is_state(record.is_state());
  return SerializeRecord(stored) == content;
}

// Returns whether the disk has room for the shared-memory index beside the log. If there is no room, SQLite reports an
// I/O error, not a full disk.
bool HasRoomForIndex(const RecordStore::Options& options) {
  if (!options.vfs.empty() || options.path == ":memory:") return true;
  constexpr std::uintmax_t kIndexBytes = 32 * 1024;
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(options.path, error);
  return error || space.available >= kIndexBytes;
}

std::string SetAsideText(const std::string& aside) {
  return "the store was damaged and is set aside as " + aside +
         "; a new store is in use, and records that no other agent holds are only in that file";
}

// Returns whether `states` contains a shared state (seq is not 0) of a greater order. Requires: all states have the
// origin, type and latest key of the state with `order`.
bool IsSuperseded(const RecordOrder& order, const std::vector<RecordTable::Row>& states) {
  return std::any_of(states.begin(), states.end(),
                     [&order](const auto& state) { return state.key.seq != 0 && state.order() > order; });
}

}  // namespace

// One transaction. The store's row ids and have-set change only after the commit.
class RecordStore::Writing {
 public:
  static Result<Writing> Begin(RecordStore& store) {
    Result<Transaction> transaction = Transaction::Begin(*store.database_);
    if (!transaction) return tl::unexpected(transaction.error());
    store.ledger_.Forget();
    store.history_.Forget();
    return Writing(store, *std::move(transaction));
  }

  // Returns the current epoch of own records. Begins an epoch if there is none.
  Result<std::uint64_t> OwnEpoch() {
    if (epoch_ != 0) return epoch_;
    const Result<OwnEpochs::Next> next = store_.own_epochs_.Draw(store_.random_);
    if (!next) return tl::unexpected(next.error());
    if (const Result<void> done = store_.own_epochs_.Write(*store_.database_, *next); !done) {
      return tl::unexpected(done.error());
    }
    begun_ = *next;
    epoch_ = next->epoch;
    return epoch_;
  }

  // Returns the key of the next own record of `type`.
  Result<RecordKey> NextKey(DataType type) {
    const Result<std::uint64_t> epoch = OwnEpoch();
    if (!epoch) return tl::unexpected(epoch.error());
    const StreamKey stream{store_.options_.self, *epoch, type};
    const StreamHave& covered = store_.ledger_.Get(stream);
    return RecordKey{stream, std::max(covered.held.Max(), covered.dropped.Max()) + 1};
  }

  Result<void> InsertRow(const RecordKey& key, const proto::Record& record, const std::string& content,
                         std::uint64_t hash) {
    const RecordTable& table = *FindRecordTable(key.stream.type);
    const Result<void> done = table.Insert(*store_.database_, next_row_id_, key, record, content, hash);
    if (!done) return done;
    ++next_row_id_;
    types_.insert(key.stream.type);
    if (key.stream.origin == store_.options_.self) own_types_.insert(key.stream.type);
    if (IsBulky(key.stream.type)) map_bytes_ += content.size();
    if (used_bytes_) (*used_bytes_)[key.stream.origin] += content.size() + kRowBytes;
    if (IsOwnNode(key.stream)) nodes_.insert(record.pose_graph_node().node().index());
    if (key.seq != 0) store_.ledger_.AddHeld(key.stream, key.seq);
    return {};
  }

  Result<void> DeleteRow(const RecordTable& table, const RecordTable::Row& row) {
    if (row.key.seq != 0) store_.ledger_.AddDropped(row.key.stream, {row.key.seq, row.key.seq});
    if (IsBulky(row.key.stream.type)) map_bytes_ -= row.content_bytes;
    if (used_bytes_) (*used_bytes_)[row.key.stream.origin] -= row.content_bytes + kRowBytes;
    if (IsOwnNode(row.key.stream)) has_removed_nodes_ = true;
    return table.Delete(*store_.database_, row.row_id);
  }

  // Removes a row because a newer record of its key replaces it.
  Result<void> Supersede(const RecordTable& table, const RecordTable::Row& row) {
    if (row.key.stream.origin == store_.options_.self) {
      if (const Result<void> done = store_.history_.Take(*store_.database_, table, row); !done) return done;
    }
    return DeleteRow(table, row);
  }

  // Returns the bytes used, by origin. Requires: RoomToShare returned a number before this transaction began.
  const std::map<AgentId, std::uint64_t>& used_bytes() const { return *used_bytes_; }
  // Indices of the nodes of this agent that this transaction inserts.
  const std::set<std::uint64_t>& nodes() const { return nodes_; }

  Result<void> Commit(proto::RecordsStored& stored) {
    if (const Result<void> done = store_.ledger_.Write(*store_.database_); !done) return done;
    if (next_row_id_ != store_.next_row_id_) {
      if (const Result<void> done = store_.WriteNextRowId(next_row_id_); !done) return done;
    }
    if (const Result<void> done = transaction_.Commit(); !done) return done;
    store_.ledger_.Keep();
    store_.history_.Keep();
    if (next_row_id_ != store_.next_row_id_) stored.set_last_row_id(next_row_id_ - 1);
    for (const DataType type : types_) stored.add_data_types(type);
    for (const DataType type : own_types_) stored.add_own_data_types(type);
    store_.next_row_id_ = next_row_id_;
    store_.map_bytes_ = map_bytes_;
    store_.used_bytes_ = std::move(used_bytes_);
    if (has_removed_nodes_) store_.own_nodes_.reset();
    if (store_.own_nodes_) store_.own_nodes_->insert(nodes_.begin(), nodes_.end());
    if (begun_) store_.own_epochs_.ObserveBegun(*begun_);
    store_.epoch_ = epoch_;
    return {};
  }

 private:
  Writing(RecordStore& store, Transaction transaction)
      : store_(store),
        transaction_(std::move(transaction)),
        epoch_(store.epoch_),
        next_row_id_(store.next_row_id_),
        map_bytes_(store.map_bytes_),
        used_bytes_(store.used_bytes_) {}

  bool IsOwnNode(const StreamKey& stream) const {
    return stream.type == proto::POSE_GRAPH_NODE && stream.origin == store_.options_.self;
  }

  RecordStore& store_;
  Transaction transaction_;
  std::uint64_t epoch_;
  std::optional<OwnEpochs::Next> begun_;
  std::uint64_t next_row_id_;
  std::uint64_t map_bytes_;
  std::optional<std::map<AgentId, std::uint64_t>> used_bytes_;
  std::set<std::uint64_t> nodes_;
  bool has_removed_nodes_ = false;
  std::set<DataType> types_;
  std::set<DataType> own_types_;  // Types of rows of this agent's own.
};

Result<std::unique_ptr<RecordStore>> RecordStore::Open(Options options) {
  Check(options.team.count(options.self) == 1, "a store's agent is in its team");
  const bool is_looked_at = !options.is_checked && options.vfs.empty();
  const std::string log_damage = is_looked_at ? FindLogDamage(options.path) : "";
  Result<std::unique_ptr<RecordStore>> store = OpenFile(options);
  if (store && !log_damage.empty()) {
    spdlog::error("storage: {}: {}", options.path, log_damage);
    (*store)->damage_.push_back(log_damage);
  }
  // Only a new process replaces a damaged file by an empty one. In a running process, other actors may have read rows
  // that an empty file lacks.
  if (store || store.error().code != ErrorCode::kCorrupt || options.is_checked) return store;
  const Result<std::string> aside = Database::SetAside(options.path, options.vfs);
  if (!aside) return tl::unexpected(aside.error());
  spdlog::error("storage: {}; it is set aside as {}, and a new store is in use", ToString(store.error()), *aside);
  store = OpenFile(options);
  if (store) {
    (*store)->set_aside_ = *aside;
    (*store)->damage_.push_back(SetAsideText(*aside));
  }
  return store;
}

Result<void> RecordStore::WriteDown(proto::EventKind kind, const std::string& text, std::int64_t utc_now_ns) {
  proto::InsertRequest request;
  *request.add_records() = MakeEvent(kind, text, "", utc_now_ns);
  const Inserted inserted = Insert(request);
  if (IsError(inserted.reply.error())) return tl::unexpected(FromProto(inserted.reply.error()));
  return {};
}

Result<void> RecordStore::LogLastRun(std::int64_t utc_now_ns) {
  const Result<std::vector<OwnEvent>> last = ReadOwnEvents(*database_, options_.self, 1);
  if (!last) return tl::unexpected(last.error());
  if (last->empty() && set_aside_.empty()) {
    set_aside_ = Database::LastSetAside(options_.path, options_.vfs);
    if (!set_aside_.empty()) damage_.push_back(SetAsideText(set_aside_));
  }
  // In a restored copy, the last event does not show how the last process ended.
  const bool is_put_back = !own_epochs_.has_incarnation();
  const Result<bool> has_ended = HasEndedWithoutStopping(*database_, options_.self);
  if (!has_ended) return tl::unexpected(has_ended.error());
  for (const std::string& text : damage_) {
    if (const Result<void> done = WriteDown(proto::EVENT_KIND_DAMAGE, text, utc_now_ns); !done) return done;
  }
  if (!*has_ended || is_put_back) return {};
  return WriteDown(proto::EVENT_KIND_LOST, kEndedWithoutStopping, utc_now_ns);
}

Result<void> RecordStore::WriteDownStop(std::int64_t utc_now_ns) {
  return WriteDown(proto::EVENT_KIND_STOPPED, "stopped on request", utc_now_ns);
}

Result<std::unique_ptr<RecordStore>> RecordStore::OpenFile(const Options& options) {
  Result<std::unique_ptr<RecordStore>> store = OpenFile(options, Database::Access::kShared);
  if (store || !IsOfTheDisk(store.error())) return store;
  const bool is_full = store.error().code == ErrorCode::kFull || !HasRoomForIndex(options);
  if (is_full && ReserveFile(options.path, options.vfs).GiveUp()) {
    spdlog::warn("storage: the disk is full: deleted the reserved space beside {} to start", options.path);
    store = OpenFile(options, Database::Access::kShared);
    if (store || !IsOfTheDisk(store.error())) return store;
  }
  Result<std::unique_ptr<RecordStore>> alone = OpenFile(options, Database::Access::kAlone);
  if (alone || alone.error().code == ErrorCode::kCorrupt) return alone;
  if (is_full) {
    const std::string files = options.vfs.empty() ? DeletableFiles(options.path) : "";
    store.error().text += "; the disk is full" + (files.empty() ? files : ": delete " + files);
  }
  return store;
}

Result<std::unique_ptr<RecordStore>> RecordStore::OpenFile(const Options& options, Database::Access access) {
  Result<std::unique_ptr<Database>> database =
      Database::Open(options.path, options.bytes_max, options.vfs, access, options.is_checked ? nullptr : CheckSchema);
  if (!database) return tl::unexpected(database.error());
  std::unique_ptr<RecordStore> store(new RecordStore(options, *std::move(database)));
  const Result<void> loaded = store->Load();
  if (loaded) return store;
  const bool is_left = loaded.error().code == ErrorCode::kCorrupt || loaded.error().code == ErrorCode::kRefused;
  if (is_left) store->database_->LeaveAsItIs();
  return tl::unexpected(loaded.error());
}

PeerAuthority::Options RecordStore::AuthorityOptions(const Options& options) {
  PeerAuthority::Options authority = options.authority;
  authority.self = options.self;
  authority.team = options.team;
  return authority;
}

Result<void> RecordStore::Load() {
  // An index that disagrees with its table hides records: they are held, but no query by key returns them.
  const Result<void> checked = options_.is_checked ? Result<void>() : database_->FullCheck();
  if (!checked && !database_->QuickCheck()) return checked;
  if (const Result<void> migrated = MigrateStore(*database_, options_.self); !migrated) return migrated;
  if (const Result<void> made = MakeSchema(*database_); !made) return made;
  if (const Result<void> claimed = Claim(); !claimed) return claimed;
  if (!checked) {
    const Result<void> rebuilt = database_->Execute("REINDEX");
    if (!rebuilt) return IsOfTheDisk(rebuilt.error()) ? rebuilt : checked;
    damage_.emplace_back("an index of the store was damaged; all indexes are rebuilt from their tables");
  }
  if (const Result<void> loaded = ledger_.Load(*database_); !loaded) return loaded;
  if (const Result<void> loaded = own_epochs_.Load(*database_); !loaded) return loaded;
  // The have-set may contain own epochs that are missing in the table own_epoch because their rows were damaged.
  for (const auto& [stream, have] : ledger_.have().streams()) {
    if (stream.origin == options_.self) own_epochs_.Learn(stream.epoch);
  }
  own_epochs_.ObserveStart();
  if (const Result<void> loaded = peer_log_.Load(*database_); !loaded) return loaded;
  if (const Result<void> loaded = authority_.Load(*database_); !loaded) return loaded;
  const Result<std::int64_t> next_row_id = database_->Number("SELECT value FROM meta WHERE name = 'next_row_id'");
  if (!next_row_id) return tl::unexpected(next_row_id.error());
  next_row_id_ = static_cast<std::uint64_t>(*next_row_id);
  if (const Result<void> loaded = write_count_.Load(*database_); !loaded) return loaded;
  if (!options_.is_checked) {
    if (const Result<void> repaired = Repair(); !repaired) return repaired;
    for (const std::string& text : damage_) spdlog::error("storage: {}: {}", database_->path(), text);
  } else if (!ledger_.is_sound()) {
    return Fail(ErrorCode::kCorrupt, "database " + database_->path() + " is damaged: its have-set");
  }
  for (const DataTypeRow& row : DataTypeRows()) {
    if (!row.is_bulky) continue;
    const auto sizes = FindRecordTable(row.type)->SizesByOrigin(*database_);
    if (!sizes) return tl::unexpected(sizes.error());
    for (const auto& [origin, size] : *sizes) map_bytes_ += size.content_bytes;
  }
  return history_.Load(*database_, ledger_.have());
}

Result<void> RecordStore::Repair() {
  const Result<RowAudit> audit = RowAudit::Read(*database_, ledger_, history_, rules_);
  if (!audit) return tl::unexpected(audit.error());
  const bool is_row_id_sound = next_row_id_ > audit->row_id_max() && next_row_id_ <= kRowIdMax;
  if (audit->is_sound() && is_row_id_sound) return {};
  if (!is_row_id_sound) {
    next_row_id_ = audit->row_id_max() + 1;
    damage_.emplace_back("the store's next row number was wrong and was corrected");
  }
  Result<Transaction> transaction = Transaction::Begin(*database_);
  if (!transaction) return tl::unexpected(transaction.error());
  if (const Result<void> done = audit->Repair(*database_, ledger_); !done) return done;
  if (const Result<void> done = WriteNextRowId(next_row_id_); !done) return done;
  if (const Result<void> done = transaction->Commit(); !done) return done;
  ledger_.Keep();
  for (const auto& [stream, have] : audit->have().streams()) {
    if (stream.origin == options_.self) own_epochs_.Learn(stream.epoch);
  }
  for (std::string& finding : audit->Findings()) damage_.push_back(std::move(finding));
  return {};
}

Result<void> RecordStore::WriteNextRowId(std::uint64_t row_id) {
  Query query = database_->Prepare("UPDATE meta SET value = ? WHERE name = 'next_row_id'");
  query << row_id;
  return query.Run();
}

Result<void> RecordStore::Claim() {
  const Result<bool> has_owner = CheckOwner(*database_, options_.self);
  if (!has_owner) return tl::unexpected(has_owner.error());
  const Result<void> done = WriteOwner(*database_, options_.self, options_.team, options_.custom_types);
  if (done || !*has_owner || !IsOfTheDisk(done.error())) return done;
  start_trouble_ = done.error();
  return {};
}

Result<void> RecordStore::TryToWrite() {
  Result<Transaction> transaction = Transaction::Begin(*database_, Database::Durability::kFull);
  if (!transaction) return tl::unexpected(transaction.error());
  if (const Result<void> done = WriteNextRowId(next_row_id_); !done) return done;
  return transaction->Commit();
}

Result<void> RecordStore::CheckOwnRecord(const proto::Record& record) const {
  Result<void> checked = CheckTeamRecord(record, options_.team);
  if (checked) checked = CheckSpeaker(record, options_.self);
  if (checked && record.has_map_quarantine()) checked = authority_.CheckOwnQuarantine(record);
  if (checked && record.has_pose_prior()) checked = authority_.CheckOwnPrior(record);
  return checked && record.has_custom() ? CheckDeclared(record.custom(), options_.custom_types) : checked;
}

// --- Own epochs ---

bool RecordStore::IsPossible(const StreamKey& stream) const {
  return stream.origin != options_.self || own_epochs_.IsPossible(stream.epoch);
}

// Each claim is judged against the epochs known before this call, so claims cannot justify one another.
std::set<std::uint64_t> RecordStore::BelievedEpochs(AgentId peer, const std::set<std::uint64_t>& claimed) {
  std::set<std::uint64_t> believed;
  for (const std::uint64_t epoch : claimed) {
    if (own_epochs_.IsKnown(epoch)) continue;
    if (!own_epochs_.IsPossible(epoch)) ++rejected_count_;
    if (own_epochs_.IsPossible(epoch) && authority_.IsBelieved(peer)) believed.insert(epoch);
  }
  return believed;
}

Result<void> RecordStore::LearnOwnEpochs(AgentId peer, const proto::HaveSet& claimed, bool is_all) {
  std::set<std::uint64_t> epochs;
  std::vector<RecordKey> beyond;
  for (const proto::StreamHave& stream : claimed.streams()) {
    if (stream.origin_agent() != options_.self) continue;
    epochs.insert(stream.epoch());
    const StreamKey key{options_.self, stream.epoch(), static_cast<DataType>(stream.data_type())};
    std::uint64_t last = 0;
    for (const proto::Interval& interval : stream.held()) last = std::max(last, interval.last());
    for (const proto::Interval& interval : stream.dropped()) last = std::max(last, interval.last());
    if (last > ledger_.have().Get(key).Covered().Max()) beyond.push_back({key, last});
  }
  authority_.ObserveOwnBeyond(peer, beyond, is_all);
  return LearnOwnEpochs(BelievedEpochs(peer, epochs));
}

Result<void> RecordStore::LearnOwnEpochs(const std::set<std::uint64_t>& epochs) {
  for (const std::uint64_t epoch : epochs) {
    if (own_epochs_.IsKnown(epoch)) continue;
    own_epochs_.Learn(epoch);
    is_reissue_due_ = true;
  }
  // Records inserted under a lower epoch would count as older than the records that peers already have. The next insert
  // therefore begins a new epoch.
  if (epoch_ < own_epochs_.highest()) epoch_ = 0;
  if (!is_reissue_due_) return {};
  const Result<void> done = Reissue();
  is_reissue_due_ = !done;
  return done;
}

Result<void> RecordStore::Reissue() {
  const Result<std::vector<RecordKey>> endangered = FindEndangered();
  if (!endangered) return tl::unexpected(endangered.error());
  if (endangered->empty()) return {};
  Result<Writing> writing = Writing::Begin(*this);
  if (!writing) return tl::unexpected(writing.error());
  for (const RecordKey& key : *endangered) {
    if (const Result<void> done = ReissueOne(key, *writing); !done) return done;
  }
  if (const Result<void> done = writing->Commit(reissued_); !done) return done;
  return {};
}

// Returns the endangered states (OwnEpochs::Danger) that no newer state has superseded, in the order of insertion.
Result<std::vector<RecordKey>> RecordStore::FindEndangered() {
  std::vector<RecordKey> found;
  const OwnEpochs::Danger danger = own_epochs_.Endangered();
  if (danger.certain.empty() && danger.possible.empty()) return found;
  std::map<DataType, std::map<std::uint64_t, IntervalSet>> newest;
  for (const auto& [stream, have] : ledger_.have().streams()) {
    const bool may_be_superseded = rules_.IsLatest(stream.type) && !IsVersioned(stream.type);
    if (stream.origin != options_.self || !may_be_superseded || have.held.is_empty()) continue;
    const bool is_guess = danger.possible.contains(stream.epoch);
    if (!is_guess && !danger.certain.contains(stream.epoch)) continue;
    if (!newest.contains(stream.type)) {
      auto of_type = FindRecordTable(stream.type)->FindNewest(*database_, options_.self, stream.type);
      if (!of_type) return tl::unexpected(of_type.error());
      newest[stream.type] = *std::move(of_type);
    }
    for (const IntervalSet::Interval& interval : newest[stream.type][stream.epoch].intervals()) {
      for (std::uint64_t seq = interval.first; seq <= interval.last; ++seq) {
        // The foreign epoch's disk may or may not have had the record. If a peer covers the record, that disk may
        // have received it from the peer, so the record does not count as endangered.
        if (is_guess && peer_log_.IsCoveredByAny({stream, seq})) continue;
        found.push_back({stream, seq});
      }
    }
  }
  return found;
}

Result<void> RecordStore::ReissueOne(const RecordKey& old_key, Writing& writing) {
  const RecordTable& table = *FindRecordTable(old_key.stream.type);
  const Result<std::optional<RecordTable::Row>> row = table.Find(*database_, old_key);
  if (!row) return tl::unexpected(row.error());
  std::string content;
  if (*row) {
    Query query = table.ReadInterval(*database_, old_key.stream, old_key.seq, old_key.seq, /*agent=*/0);
    if (const Result<bool> read = query.Step(); !read) return tl::unexpected(read.error());
    content = table.Read(query).content();
  }
  proto::Record record;
  if (!*row || HashRecord(old_key, content) != (*row)->hash || !record.ParseFromString(content)) {
    return Fail(ErrorCode::kCorrupt, "database " + database_->path() + " is damaged: " + ToString(old_key));
  }
  // A record that was inserted under the policy `all` is never superseded, so it needs no reissue.
  if (!record.is_state()) return {};
  const Result<RecordKey> key = writing.NextKey(old_key.stream.type);
  if (!key) return tl::unexpected(key.error());
  if (const Result<void> done = writing.DeleteRow(table, **row); !done) return done;
  return InsertSigned(*key, record, content, writing);
}

proto::RecordsStored RecordStore::TakeReissued() { return std::exchange(reissued_, {}); }

Result<void> RecordStore::ObserveEpochReport(AgentId peer, const proto::EpochReport& report) {
  if (report.epochs_size() > kEpochReportMax) {
    return Fail(ErrorCode::kInvalid, "has more than " + std::to_string(kEpochReportMax) + " entries", "epochs");
  }
  std::uint64_t last = 0;
  for (const std::uint64_t epoch : report.epochs()) {
    if (epoch <= last) return Fail(ErrorCode::kInvalid, "must be at least 1 and in rising order", "epochs");
    last = epoch;
  }
  std::vector<RecordKey> unknown;
  for (const std::uint64_t epoch : report.epochs()) {
    if (!own_epochs_.IsKnown(epoch)) unknown.push_back({{options_.self, epoch, 0}, 0});
  }
  // `unknown` must be computed before LearnOwnEpochs: a learned epoch counts as known, even if no peer has returned any
  // of its records yet.
  authority_.ObserveOwnBeyond(peer, unknown, /*is_all=*/false);
  return LearnOwnEpochs(BelievedEpochs(peer, {report.epochs().begin(), report.epochs().end()}));
}

proto::EpochReport RecordStore::ReportEpochs(AgentId origin) const {
  std::set<std::uint64_t> epochs;
  const auto& streams = ledger_.have().streams();
  for (auto it = streams.lower_bound({origin, 0, 0}); it != streams.end() && it->first.origin == origin; ++it) {
    epochs.insert(it->first.epoch);
    if (epochs.size() > kEpochReportMax) epochs.erase(epochs.begin());
  }
  proto::EpochReport report;
  *report.mutable_epochs() = {epochs.begin(), epochs.end()};
  return report;
}

// --- Inserts ---

Result<void> RecordStore::CheckInsert(const proto::InsertRequest& request) const {
  if (request.records_size() > kInsertRecordsMax) {
    return Fail(ErrorCode::kInvalid, "more than " + std::to_string(kInsertRecordsMax) + " records", "records");
  }
  for (int i = 0; i < request.records_size(); ++i) {
    Result<void> checked = CheckOwnRecord(request.records(i));
    if (checked) checked = CheckForInsert(request.records(i), request.is_local());
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
  const Result<std::uint64_t> used = UsedByRecords(*database_, history_.sum().bytes);
  if (!used) return tl::unexpected(used.error());
  return CheckBudgetForOwnMaps(*used, options_.map_store_bytes_max);
}

Result<void> RecordStore::CheckRoomForOthersMaps() {
  if (options_.map_store_bytes_max == 0 || authority_.HasRole(options_.self)) return {};
  const Result<std::uint64_t> used = UsedByRecords(*database_, history_.sum().bytes);
  if (!used) return tl::unexpected(used.error());
  return CheckBudgetForOthersMaps(*used, options_.map_store_bytes_max);
}

Result<std::optional<std::uint64_t>> RecordStore::RoomToShare() {
  const Result<std::uint64_t> used = database_->UsedPageBytes();
  if (!used) return tl::unexpected(used.error());
  const Result<std::uint64_t> free = database_->FreePageBytes();
  if (!free) return tl::unexpected(free.error());
  std::uint64_t room = options_.bytes_max == 0 ? UINT64_MAX : options_.bytes_max;
  if (const std::optional<DiskSpace> space = database_->GetDiskSpace()) {
    room = std::min(room, *used + *free + space->free_bytes);
  }
  if (*used < room / 2 / options_.team.size()) return std::optional<std::uint64_t>();
  if (!used_bytes_) {
    std::map<AgentId, std::uint64_t> counted;
    for (const RecordTable& table : RecordTables()) {
      const auto sizes = table.SizesByOrigin(*database_);
      if (!sizes) return tl::unexpected(sizes.error());
      for (const auto& [origin, size] : *sizes) counted[origin] += size.content_bytes + size.row_count * kRowBytes;
    }
    used_bytes_ = std::move(counted);
  }
  return std::optional(room);
}

RecordStore::Inserted RecordStore::Insert(const proto::InsertRequest& request) {
  const auto is_marked = [this](const proto::Record& record) {
    return record.is_state() == rules_.IsLatest(TypeOf(record));
  };
  if (!std::all_of(request.records().begin(), request.records().end(), is_marked)) {
    proto::InsertRequest marked = request;
    for (proto::Record& record : *marked.mutable_records()) record.set_is_state(rules_.IsLatest(TypeOf(record)));
    return Insert(marked);
  }
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
  std::uint64_t bytes = 0;
  for (const std::string& content : contents) bytes += content.size();
  if (done && request.records_size() > 0) {
    done = InsertAll(request, contents, result);
    if (!done && MakesRoom(done.error(), bytes)) {
      result = Inserted();
      done = InsertAll(request, contents, result);
    }
  }
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
    const bool is_same = *named && IsRepeated((*named)->content, record, content);
    if (is_same && ((*named)->key.seq == 0) == is_local) {
      reply_key = ToProto((*named)->key);
      return {};
    }
    if (*named) {
      const char* as = !is_same   ? "with other content"
                       : is_local ? "and is shared with other agents"
                                  : "and is not shared (--local)";
      return Fail(ErrorCode::kInvalid, name + " already exists " + as, table.name());
    }
  }
  if (record.pose_graph_edge().has_relative_pose() && record.pose_graph_edge().source().empty()) {
    const Result<void> consecutive = CheckConsecutive(record.pose_graph_edge(), writing);
    if (!consecutive) return consecutive;
  }
  RecordKey key{StreamKey{options_.self, 0, type}, 0};
  if (!is_local) {
    const Result<RecordKey> next = writing.NextKey(type);
    if (!next) return tl::unexpected(next.error());
    key = *next;
  }
  if (record.is_state()) {
    const RecordOrder order = OrderOf(key, record);
    const Result<std::vector<RecordTable::Row>> others =
        table.FindStates(*database_, options_.self, type, LatestKey(record));
    if (!others) return tl::unexpected(others.error());
    if (!is_local && IsSuperseded(order, *others)) {
      ledger_.AddDropped(key.stream, {key.seq, key.seq});
      reply_key = ToProto(key);
      return {};
    }
    for (const RecordTable::Row& other : *others) {
      // A local state cannot supersede a shared state, because peers still need the shared state.
      if (other.key.seq != 0 && (is_local || other.order() > order)) continue;
      if (const Result<void> done = writing.Supersede(table, other); !done) return done;
    }
  }
  reply_key = ToProto(key);
  return InsertSigned(key, record, content, writing);
}

Result<void> RecordStore::CheckConsecutive(const proto::PoseGraphEdge& edge, const Writing& writing) {
  const auto [first, last] = std::minmax({edge.from().index(), edge.to().index()});
  if (last - first <= 1) return {};
  if (!own_nodes_) {
    std::set<std::uint64_t> nodes;
    Query query = database_->Prepare("SELECT node_index FROM pose_graph_node WHERE origin = ?");
    query << options_.self;
    while (true) {
      const Result<bool> row = query.Step();
      if (!row) return tl::unexpected(row.error());
      if (!*row) break;
      nodes.insert(query.Unsigned(0));
    }
    // Nodes that this transaction inserts do not count as stored yet.
    for (const std::uint64_t index : writing.nodes()) nodes.erase(index);
    own_nodes_ = std::move(nodes);
  }
  const std::set<std::uint64_t>* const stored_and_new[] = {&*own_nodes_, &writing.nodes()};
  for (const std::set<std::uint64_t>* nodes : stored_and_new) {
    const auto next = nodes->upper_bound(first);
    if (next == nodes->end() || *next >= last) continue;
    return Fail(ErrorCode::kInvalid,
                "node " + std::to_string(options_.self) + ":" + std::to_string(*next) +
                    " lies between: odometry must join consecutive nodes; for a loop closure, set the source",
                "pose_graph_edge.to");
  }
  return {};
}

Result<void> RecordStore::InsertSigned(const RecordKey& key, const proto::Record& record, const std::string& content,
                                       Writing& writing) {
  if (!options_.sign || !record.has_map_quarantine()) {
    return writing.InsertRow(key, record, content, HashRecord(key, content));
  }
  proto::Record signed_record = record;
  *signed_record.mutable_map_quarantine()->mutable_term() = authority_.newest_term();
  signed_record.mutable_map_quarantine()->set_signature(options_.sign(key, signed_record));
  const std::string signed_content = SerializeRecord(signed_record);
  return writing.InsertRow(key, signed_record, signed_content, HashRecord(key, signed_content));
}

void RecordStore::Reject(Error error, Stored& result) {
  ++rejected_count_;
  result.reply.set_rejected_count(result.reply.rejected_count() + 1);
  if (error.code == ErrorCode::kRefused) result.reply.set_untrusted_count(result.reply.untrusted_count() + 1);
  if (result.rejections.size() < kRejectionsKept) result.rejections.push_back(std::move(error));
}

// Notes the signed assignments in the request. Call before the records are checked, because an assignment may decide
// which records are accepted.
void RecordStore::ObserveAssignmentsIn(const proto::StoreRequest& request) {
  for (const proto::StoredRecord& stored : request.records()) {
    if (stored.key().data_type() != proto::ROLE_ASSIGNMENT) continue;
    const Result<proto::Record> record = OpenStored(stored, options_.team);
    if (record) authority_.ObserveIfSigned(record->role_assignment());
  }
}

// Returns the records of the request that pass validation. Rejects and counts the other records.
std::vector<RecordStore::Opened> RecordStore::OpenBrought(const proto::StoreRequest& request, Stored& result) {
  std::vector<Opened> opened;
  for (const proto::StoredRecord& stored : request.records()) {
    const RecordKey key = FromProto(stored.key());
    Result<proto::Record> record = OpenStored(stored, options_.team);
    const bool is_forged = key.stream.origin == options_.self && key.stream.epoch == epoch_ && epoch_ != 0 &&
                           key.seq > ledger_.have().Get(key.stream).Covered().Max();
    if (record && is_forged)
      record = Fail(ErrorCode::kInvalid, "is above the last number that this agent assigned", "key.seq");
    if (record && !IsPossible(key.stream))
      record = Fail(ErrorCode::kInvalid, "is too far ahead of this agent's epoch", "key.epoch");
    if (record) {
      const Result<void> brought = CheckBrought(request.sender(), key, *record);
      if (!brought) record = tl::unexpected(brought.error());
    }
    if (record) {
      if (const Result<void> stated = CheckSpeaker(*record, key.stream.origin); !stated) {
        authority_.CountStatement(key.stream.origin);
        result.never_valid.push_back(key);
        record = Fail(ErrorCode::kRefused, stated.error().text, stated.error().field);
      }
    }
    if (record) {
      opened.push_back(Opened{key, *std::move(record), &stored});
    } else {
      Reject(Error{record.error().code, ToString(key) + ": " + record.error().text, record.error().field}, result);
    }
  }
  return opened;
}

RecordStore::Stored RecordStore::Store(const proto::StoreRequest& request) {
  Stored result;
  ObserveAssignmentsIn(request);
  const std::vector<Opened> opened = OpenBrought(request, result);
  std::set<StreamKey> touched;
  for (const Opened& record : opened) touched.insert(record.key.stream);
  for (const RecordKey& key : result.never_valid) touched.insert(key.stream);
  HaveSet dropped;
  for (const proto::StreamHave& stream : request.dropped()) {
    // Ignore drops of a type that may not be dropped here. The sender's team file may have another policy for the type.
    if (!rules_.MayBeDropped(static_cast<DataType>(stream.data_type()))) continue;
    const Result<void> checked = CheckDropped(request.sender(), stream, dropped);
    if (!checked) Reject(checked.error(), result);
  }
  for (const auto& [stream, have] : dropped.streams()) touched.insert(stream);
  std::set<std::uint64_t> own_epochs;
  for (const StreamKey& stream : touched) {
    if (stream.origin == options_.self) own_epochs.insert(stream.epoch);
  }

  const Stored before = result;
  const std::uint64_t rejected_before = rejected_count_;
  const auto store = [&] {
    const Result<void> trained = LearnOwnEpochs(own_epochs);
    return trained ? StoreAll(request.sender(), opened, dropped, result) : trained;
  };
  std::uint64_t bytes = 0;
  for (const Opened& record : opened) bytes += record.stored->content().size();
  Result<void> done = store();
  if (!done && MakesRoom(done.error(), bytes)) {
    result = before;
    rejected_count_ = rejected_before;
    done = store();
  }
  if (!done) {
    result = Stored();
    *result.reply.mutable_error() = ToProto(done.error());
    return result;
  }
  HaveSet covered;
  for (const StreamKey& stream : touched) covered[stream] = ForPeer(stream.type, ledger_.have().Get(stream));
  for (const RecordKey& key : result.never_valid) covered[key.stream].held.Add(key.seq);
  *result.reply.mutable_covered() = ToProto(covered);
  if (result.reply.covered().ByteSizeLong() <= kHavePageBytesMax) return result;
  // The reply would be too long. Report only the intervals that contain a record of the request. Intervals that contain
  // only dropped records are left out.
  HaveSet named;
  for (const Opened& record : opened) named[record.key.stream].held.Add(record.key.seq);
  for (const RecordKey& key : result.never_valid) named[key.stream].held.Add(key.seq);
  *result.reply.mutable_covered() = ToProto(covered.Around(named));
  return result;
}

Result<void> RecordStore::CheckBrought(AgentId sender, const RecordKey& key, const proto::Record& record) {
  if (record.has_role_assignment()) return authority_.CheckAssignment(sender, record.role_assignment());
  return authority_.CheckRecord(sender, key, record);
}

Result<void> RecordStore::StoreAll(AgentId sender, const std::vector<Opened>& opened, const HaveSet& dropped,
                                   Stored& result) {
  if (opened.empty() && dropped.streams().empty()) return {};
  const Result<std::optional<std::uint64_t>> room_bytes = RoomToShare();
  if (!room_bytes) return tl::unexpected(room_bytes.error());
  Result<Writing> writing = Writing::Begin(*this);
  if (!writing) return tl::unexpected(writing.error());
  for (const Opened& record : opened) {
    if (const Result<void> done = StoreOne(sender, record, *room_bytes, *writing, result); !done) return done;
  }
  for (const auto& [stream, have] : dropped.streams()) {
    if (const Result<void> room = authority_.CheckRoom(sender, stream, ledger_); !room) {
      Reject(room.error(), result);
    } else if (const Result<void> done = ApplyDropped(stream, have.dropped, *writing); !done) {
      return done;
    }
  }
  if (const Result<void> done = writing->Commit(result.stored); !done) return done;
  for (const Opened& record : opened) {
    if (record.record.has_role_assignment())
      authority_.ObserveAssignment(record.record.role_assignment(), /*is_record=*/true);
  }
  return {};
}

Result<void> RecordStore::StoreOne(AgentId sender, const Opened& opened, std::optional<std::uint64_t> room_bytes,
                                   Writing& writing, Stored& result) {
  if (const Result<void> room = authority_.CheckRoom(sender, opened.key.stream, ledger_); !room) {
    Reject(room.error(), result);
    return {};
  }
  const RecordTable& table = *FindRecordTable(opened.key.stream.type);
  const StreamHave& have = ledger_.Get(opened.key.stream);
  if (have.dropped.Contains(opened.key.seq)) return {};
  if (have.held.Contains(opened.key.seq)) {
    const Result<std::optional<RecordTable::Row>> held = table.Find(*database_, opened.key);
    if (!held) return tl::unexpected(held.error());
    if (*held && (*held)->hash != opened.stored->hash()) {
      Reject(Error{ErrorCode::kInvalid, ToString(opened.key) + ": is stored with different content", "hash"}, result);
    }
    return {};
  }
  std::vector<RecordTable::Row> superseded;
  const DataType type = opened.key.stream.type;
  if (rules_.IsLatest(type) && opened.record.is_state()) {
    const RecordOrder order = OrderOf(opened.key, opened.record);
    const Result<std::vector<RecordTable::Row>> others =
        table.FindStates(*database_, opened.key.stream.origin, type, LatestKey(opened.record));
    if (!others) return tl::unexpected(others.error());
    if (IsSuperseded(order, *others)) {
      ledger_.AddDropped(opened.key.stream, {opened.key.seq, opened.key.seq});
      return {};
    }
    std::copy_if(others->begin(), others->end(), std::back_inserter(superseded),
                 [&order](const auto& other) { return other.key.seq != 0 && other.order() < order; });
  }
  std::uint64_t superseded_bytes = 0;
  for (const RecordTable::Row& row : superseded) superseded_bytes += row.content_bytes;
  if (room_bytes && (superseded.empty() || opened.stored->content().size() > superseded_bytes)) {
    const Result<void> room = authority_.CheckDiskRoom(opened.key.stream.origin, writing.used_bytes(), *room_bytes);
    if (!room) {
      Reject(room.error(), result);
      return {};
    }
  }
  for (const RecordTable::Row& row : superseded) {
    if (const Result<void> done = writing.Supersede(table, row); !done) return done;
  }
  if (opened.key.stream.origin == options_.self) {
    if (const Result<void> done = history_.Remove(*database_, opened.key); !done) return done;
  }
  result.reply.set_stored_count(result.reply.stored_count() + 1);
  return writing.InsertRow(opened.key, opened.record, opened.stored->content(), opened.stored->hash());
}

Result<void> RecordStore::CheckDropped(AgentId sender, const proto::StreamHave& dropped, HaveSet& accepted) {
  proto::HaveSet single;
  *single.add_streams() = dropped;
  single.mutable_streams(0)->clear_held();
  const Result<HaveSet> read = FromProto(single);
  if (!read) return tl::unexpected(read.error());
  const StreamKey& stream = read->streams().begin()->first;
  const IntervalSet& seqs = read->streams().begin()->second.dropped;
  if (!options_.team.count(stream.origin))
    return Fail(ErrorCode::kInvalid, "is not in the team", "dropped.origin_agent");
  if (const Result<void> checked = authority_.CheckOrigin(sender, stream); !checked) return checked;
  if (stream.epoch == 0) return Fail(ErrorCode::kInvalid, "is missing", "dropped.epoch");
  if (!IsPossible(stream)) return Fail(ErrorCode::kInvalid, "is too far ahead of this agent's epoch", "dropped.epoch");
  const bool is_present_own = stream.origin == options_.self && stream.epoch == epoch_;
  const std::uint64_t seq_max = is_present_own ? ledger_.have().Get(stream).Covered().Max() : kSeqMax;
  if (seqs.Max() > seq_max)
    return Fail(ErrorCode::kInvalid, "lists sequence numbers above the last one of the stream", "dropped.dropped");
  accepted[stream].dropped.Add(seqs);
  return {};
}

Result<void> RecordStore::ApplyDropped(const StreamKey& stream, const IntervalSet& dropped, Writing& writing) {
  const RecordTable& table = *FindRecordTable(stream.type);
  const IntervalSet held = ledger_.Get(stream).held;
  const IntervalSet never_held = dropped.Minus(held);
  IntervalSet superseded = never_held;
  const RecordKey newest = ledger_.NewestHeld(stream.origin, stream.type);
  // Records with a RecordVersion are ordered by the term and run in it. A report of dropped seqs does not contain the
  // versions, so any held record may be newer than the dropped records.
  const bool is_order_known = !IsVersioned(stream.type);
  if (newest.seq == 0 || (is_order_known && newest.stream.epoch < stream.epoch)) {
    superseded = IntervalSet();
  } else if (is_order_known && newest.stream.epoch == stream.epoch) {
    IntervalSet not_older;
    not_older.Add({newest.seq, kSeqMax});
    superseded = never_held.Minus(not_older);
  }
  for (const IntervalSet::Interval& interval : superseded.intervals()) ledger_.AddDropped(stream, interval);
  const IntervalSet held_and_dropped = dropped.Minus(never_held);
  std::map<std::string, std::set<std::uint64_t>> superseded_rows;  // Row ids of superseded states, by latest key.
  for (const IntervalSet::Interval& interval : held_and_dropped.intervals()) {
    const Result<std::vector<RecordTable::Row>> rows =
        table.FindInInterval(*database_, stream, interval.first, interval.last);
    if (!rows) return tl::unexpected(rows.error());
    for (const RecordTable::Row& row : *rows) {
      const auto [known, is_new] = superseded_rows.try_emplace(row.latest_key);
      if (is_new) {
        Result<std::vector<RecordTable::Row>> states =
            table.FindStates(*database_, stream.origin, stream.type, row.latest_key);
        if (!states) return tl::unexpected(states.error());
        std::erase_if(*states, [](const auto& state) { return state.key.seq == 0; });
        std::sort(states->begin(), states->end(), [](const auto& a, const auto& b) { return a.order() > b.order(); });
        for (std::size_t i = 1; i < states->size(); ++i) known->second.insert((*states)[i].row_id);
      }
      if (!known->second.contains(row.row_id)) continue;
      if (const Result<void> done = writing.Supersede(table, row); !done) return done;
    }
  }
  return {};
}

StreamHave RecordStore::ForPeer(DataType type, const StreamHave& have) const {
  const bool is_pruned = !rules_.MayBeDropped(type) && !have.dropped.is_empty();
  if (rules_.IsLatest(type) || is_pruned) return {.held = {}, .dropped = have.Covered()};
  return have;
}

proto::HaveReply RecordStore::GetHave(const proto::HaveRequest& request) const {
  const std::set<AgentId> origins(request.origin_agents().begin(), request.origin_agents().end());
  const std::set<DataType> everyones(request.everyones_types().begin(), request.everyones_types().end());
  const RecordKey from = FromProto(request.from());
  HavePageWriter writer(from, request.bytes_max());
  const auto& streams = ledger_.have().streams();
  for (auto it = streams.lower_bound(from.stream); it != streams.end(); ++it) {
    const auto& [key, have] = *it;
    if (!origins.empty() && !origins.contains(key.origin) && !everyones.contains(key.type)) continue;
    if (!writer.Add(key, request.is_for_peer() ? ForPeer(key.type, have) : have)) break;
  }
  proto::HaveReply reply;
  *reply.mutable_have() = std::move(writer.page());
  if (writer.next()) *reply.mutable_next() = ToProto(*writer.next());
  reply.set_epoch(epoch_);
  return reply;
}

Result<proto::MissingReply> RecordStore::GetMissing(const proto::MissingRequest& request) {
  // Ignore all errors except kCorrupt: peers can read records even while the disk accepts no writes. Endangered states
  // are reissued later, before the first record of a later epoch is stored.
  const Result<void> trained = LearnOwnEpochs(request.destination(), request.destination_have(), /*is_all=*/false);
  if (!trained && trained.error().code == ErrorCode::kCorrupt) return tl::unexpected(trained.error());
  return FindMissing(*database_, ledger_.have(), rules_, authority_.IsBelieved(options_.self), MarkedBy(request),
                     request);
}

const HaveSet* RecordStore::MarkedBy(const proto::MissingRequest& request) {
  if (request.mark() == 0) return nullptr;
  Mark& mark = marks_[{request.destination(), request.kind()}];
  if (mark.number != request.mark()) mark = {request.mark(), ledger_.have()};
  return &mark.have;
}

Result<proto::ReadReply> RecordStore::Read(const proto::ReadRequest& request) {
  if (request.after_row_id() > INT64_MAX && !request.is_newest_first()) {
    // SQLite would take the number as a negative one, which lies before all rows.
    proto::ReadReply nothing;
    nothing.set_is_complete(true);
    return nothing;
  }
  return request.is_history() ? history_.Read(*database_, request) : ReadPage(*database_, request);
}

Result<bool> RecordStore::TrimHistory(std::optional<std::int64_t> utc_now_ns) {
  history_.Forget();
  if (!history_.NeedsTrim()) return false;
  Result<Writing> writing = Writing::Begin(*this);
  if (!writing) return tl::unexpected(writing.error());
  const Result<bool> has_more = history_.Trim(*database_, utc_now_ns);
  if (!has_more) return has_more;
  proto::RecordsStored nothing;
  if (const Result<void> done = writing->Commit(nothing); !done) return tl::unexpected(done.error());
  return has_more;
}

Result<std::uint64_t> RecordStore::DropHistory(std::uint64_t bytes) {
  if (history_.sum().count == 0) return 0;
  Result<Writing> writing = Writing::Begin(*this);
  if (!writing) return tl::unexpected(writing.error());
  const Result<std::uint64_t> freed = history_.Drop(*database_, bytes);
  if (!freed) return freed;
  proto::RecordsStored nothing;
  if (const Result<void> done = writing->Commit(nothing); !done) return tl::unexpected(done.error());
  return freed;
}

bool RecordStore::MakesRoom(const Error& failure, std::uint64_t content_bytes) {
  history_.Forget();
  if (failure.code != ErrorCode::kFull || history_.sum().count == 0) return false;
  // Remove twice the content's bytes: rows of the history share pages with other rows, and a record takes more space
  // than its content.
  const Result<std::uint64_t> freed = DropHistory(std::max(kRoomBytesMin, 2 * content_bytes));
  if (freed && *freed > 0) {
    spdlog::warn("storage: {} is full; {} bytes of history were removed for new records", database_->path(), *freed);
  }
  return freed && *freed > 0;
}

Result<proto::RecordsStored> RecordStore::SaveRoles(const proto::SaveRolesRequest& request) {
  Result<Writing> writing = Writing::Begin(*this);
  if (!writing) return tl::unexpected(writing.error());
  for (const proto::RoleAssignment& roles : request.chain()) {
    if (const Result<bool> added = AddRoles(*database_, roles); !added) return tl::unexpected(added.error());
  }
  const proto::RoleAssignment& roles = request.roles();
  const Result<bool> added = AddRoles(*database_, roles);
  if (!added) return tl::unexpected(added.error());
  const bool has_role = roles.leader() == options_.self || roles.survivor() == options_.self;
  for (const proto::RoleAssignment& before : request.chain()) authority_.ObserveAssignment(before, /*is_record=*/false);
  authority_.ObserveAssignment(roles, /*is_record=*/false);
  std::vector<proto::RoleAssignment> records;
  if (*added && has_role) records = authority_.NotHeldAsRecords(roles);
  std::reverse(records.begin(), records.end());
  for (const proto::RoleAssignment& before : records) {
    proto::Record record;
    record.set_timestamp_ns(before.timestamp_ns());
    *record.mutable_role_assignment() = before;
    proto::RecordKey key;
    const Result<void> done = InsertOne(record, SerializeRecord(record), /*is_local=*/false, *writing, key);
    if (!done) return tl::unexpected(done.error());
  }
  proto::RecordsStored stored;
  if (const Result<void> done = writing->Commit(stored); !done) return tl::unexpected(done.error());
  for (const proto::RoleAssignment& before : records) authority_.ObserveAssignment(before, /*is_record=*/true);
  return stored;
}

Result<proto::LoadRolesReply> RecordStore::LoadRoles() {
  Result<proto::LoadRolesReply> reply = moondb::LoadRoles(*database_);
  if (!reply) return reply;
  const Result<std::vector<proto::RoleAssignment>> known = LoadRoleRecords(*database_);
  if (!known) return tl::unexpected(known.error());
  *reply->mutable_known() = {known->begin(), known->end()};
  return reply;
}

Result<bool> RecordStore::ObservePeerHave(const proto::PeerHave& note) {
  const auto& origins = note.origin_agents();
  const bool speaks_of_self =
      origins.empty() || std::find(origins.begin(), origins.end(), options_.self) != origins.end();
  const bool is_all = note.has_acknowledged() && !note.is_difference() && speaks_of_self;
  const Result<void> trained = LearnOwnEpochs(note.peer(), note.acknowledged(), is_all);
  if (!trained) return tl::unexpected(trained.error());
  return peer_log_.Store(*database_, note);
}

Result<std::vector<proto::HealthFinding>> RecordStore::Findings() { return ReadFindings(*database_, options_.self); }

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
  const Result<std::uint64_t> used = UsedByRecords(*database_, history_.sum().bytes);
  if (!used) return tl::unexpected(used.error());
  status.set_database_bytes(static_cast<double>(*used + database_->WalBytes()));
  status.set_disk_free_bytes(static_cast<double>(database_->GetDiskSpace().value_or(DiskSpace()).free_bytes));
  status.set_epoch(epoch_);
  status.set_rejected_count(static_cast<double>(rejected_count_));
  status.set_wal_bytes(static_cast<double>(database_->WalBytes()));
  status.set_map_bytes(static_cast<double>(map_bytes_));
  status.set_pruned_count(static_cast<double>(pruned_count_));
  status.set_history_count(static_cast<double>(history_.sum().count));
  status.set_history_bytes(static_cast<double>(history_.sum().bytes));
  for (const auto& [written_on, bytes] : write_count_.Days(*database_, day)) {
    proto::DayBytes& added = *status.add_written();
    added.set_day(written_on);
    added.set_bytes(static_cast<double>(bytes));
  }
  if (const Result<void> added = AddMapTimes(*database_, ledger_.have(), status); !added) {
    return tl::unexpected(added.error());
  }
  return status;
}

Result<proto::PruneReply> RecordStore::PruneHistory(const proto::PruneRequest& request, std::int64_t utc_now_ns) {
  Result<Writing> writing = Writing::Begin(*this);
  if (!writing) return tl::unexpected(writing.error());
  Result<proto::PruneReply> reply = history_.Prune(*database_, request, utc_now_ns);
  if (!reply || request.is_dry_run()) return reply;
  proto::RecordsStored nothing;
  if (const Result<void> done = writing->Commit(nothing); !done) return tl::unexpected(done.error());
  return reply;
}

Result<proto::PruneReply> RecordStore::Prune(const proto::PruneRequest& request, std::int64_t utc_now_ns,
                                             std::size_t rows_max) {
  if (request.is_history()) return PruneHistory(request, utc_now_ns);
  Result<PruneChoice> choice = ChooseToPrune(*database_, ledger_.have(), rules_, request, utc_now_ns);
  if (!choice) return tl::unexpected(choice.error());
  if (choice->rows.size() > rows_max) {
    choice->rows.resize(rows_max);
    choice->is_complete = false;
  }
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
