#include "actors/storage/storage_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <utility>

#include "actors/storage/map_budget.h"
#include "model/agent_name.h"
#include "model/control_message.h"
#include "model/data_types.h"
#include "model/event.h"
#include "model/team_member.h"
#include "model/text.h"
#include "proto/control.pb.h"
#include "proto/types.pb.h"
#include "runtime/team/record_signature.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/team_config.h"

namespace moondb {

namespace {

enum TimerKind : std::uint32_t { kScrub = 1, kSaveWritten = 2, kTend = 3, kTrimHistory = 4 };

// Maximum number of rows per prune on a full disk. Removing so few rows needs little space.
constexpr std::size_t kRowsOnFullDisk = 200;

constexpr double kMegabyte = 1e6;
std::uint32_t DayOf(std::int64_t utc_ns) {
  constexpr std::int64_t kDay_ns = 86'400'000'000'000;
  return utc_ns < 0 ? 0 : static_cast<std::uint32_t>(utc_ns / kDay_ns);
}

std::string Megabytes(double bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f MB", bytes / kMegabyte);
  return text;
}

constexpr std::uint64_t kHistoryDropBytes = 1024 * 1024;

// Removes history if the disk is short of room, before records are refused. Pages that become free within the file
// count as room.
void DropHistoryWhereShort(const DiskGuard& disk, RecordStore& store) {
  const Result<void> room = disk.CheckRoom(store.database(), DiskGuard::Kind::kOthersMap);
  if (room || room.error().code != ErrorCode::kFull) return;
  const Result<std::uint64_t> freed = store.DropHistory(kHistoryDropBytes);
  if (freed && *freed > 0) spdlog::warn("storage: the disk is nearly full: {} bytes of history were removed", *freed);
}

bool HasRecordsOf(AgentId agent, const proto::MissingReply& reply) {
  return std::any_of(reply.records().begin(), reply.records().end(),
                     [agent](const proto::StoredRecord& record) { return record.key().origin_agent() == agent; });
}

}  // namespace

StorageActor::StorageActor(Options options)
    : options_(std::move(options)),
      clock_(BaseStationOf(options_.team)),
      copies_(options_.self, options_.team),
      disk_(options_.path, options_.vfs, AgentName(options_.team, options_.self)) {}

StorageActor::~StorageActor() {
  const std::optional<std::int64_t> stopped_at_ns =
      store_ && options_.stopped_at_ns ? options_.stopped_at_ns() : std::nullopt;
  if (!stopped_at_ns) return;
  const Result<void> written = store_->WriteDownStop(*stopped_at_ns);
  if (!written) spdlog::warn("storage: cannot store the event that this agent stopped: {}", ToString(written.error()));
}

RecordStore::Options StorageActor::StoreOptions(const Options& options) {
  RecordStore::Options store;
  store.path = options.path;
  store.vfs = options.vfs;
  store.self = options.self;
  store.bytes_max = options.bytes_max;
  store.map_store_bytes_max = static_cast<std::uint64_t>(options.team.retention().store_mb_max() * kMegabyte);
  store.is_checked = options.is_checked;
  for (const proto::AgentConfig& agent : options.team.agents()) store.team.insert(agent.id());
  for (const DataType type : BuiltInDataTypes()) store.policies[type] = SharePolicyOf(options.team, type);
  store.custom_types = options.team.custom_types();
  store.history.bytes_max = static_cast<std::uint64_t>(options.team.retention().history_mb_max() * kMegabyte);
  for (const DataType type : DataTypesOf(options.team)) {
    if (SharePolicyOf(options.team, type) != proto::POLICY_LATEST) continue;
    store.history.keep[type] = KeepRuleOf(options.team, type);
  }
  store.authority.base = BaseStationOf(options.team);
  store.authority.roles = RoleChainOptions(options.team);
  store.authority.is_signed = [team = options.team](const proto::RoleAssignment& roles) {
    return IsSigned(team, roles);
  };
  store.authority.is_record_signed = [team = options.team](const RecordKey& key, const proto::Record& record) {
    return IsSigned(team, key, record);
  };
  store.sign = options.sign;
  if (options.self == BaseStationOf(options.team)) {
    for (const DataType type : DataTypesOf(options.team)) {
      if (GroundPolicyOf(options.team, type) == proto::POLICY_ALL) store.for_ground.insert(type);
    }
  }
  return store;
}

void StorageActor::OnStart(Context& context) {
  if (!OpenStore(context)) return;
  proto::RecordsStored changed;
  // Before its restart, this actor may have pruned records without notifying other actors.
  changed.set_is_pruned(true);
  Publish(context, changed);
  context.WatchPeers();
  (void)IsClockSuspect(context);  // The first call starts the detection of clock jumps.
  SaveWritten(context);
  (void)context.AfterTimer(options_.tend_period, kTend);
  (void)context.AfterTimer(options_.history_period, kTrimHistory);
  next_scrub_.set_part(proto::VERIFY_PART_ROWS);
  if (options_.scrub_period > Duration::zero()) (void)context.AfterTimer(options_.scrub_period, kScrub);
}

bool StorageActor::OpenStore(Context& context) {
  RecordStore::Options options = StoreOptions(options_);
  options.seed = context.rng()();
  Result<std::unique_ptr<RecordStore>> store = RecordStore::Open(std::move(options));
  if (!store) {
    spdlog::error("storage: {}", ToString(store.error()));
    context.Fail(store.error());
    return false;
  }
  store_ = *std::move(store);
  copies_.ObserveTime(context.now(), store_->next_row_id());
  if (store_->database().access() == Database::Access::kReadOnly) {
    ObserveWrite(CheckRoom(DiskGuard::Kind::kRecord));
  } else if (store_->start_trouble()) {
    ObserveWrite(tl::unexpected(*store_->start_trouble()));
  }
  return true;
}

void StorageActor::OnMessage(Context& context, const proto::Message& message) {
  if (!store_) return;
  if (context.sender().agent != options_.self) return OnFromPeer(context, message);
  switch (message.body_case()) {
    case proto::Message::kPeerEvent:
      return OnPeerEvent(context, message.peer_event());
    case proto::Message::kInsertRequest:
      return OnInsert(context, message.insert_request());
    case proto::Message::kStoreRequest:
      return OnStore(context, message.store_request());
    case proto::Message::kHaveRequest: {
      proto::Message reply;
      *reply.mutable_have_reply() = store_->GetHave(message.have_request());
      return Answer(context, std::move(reply));
    }
    case proto::Message::kMissingRequest:
      return OnMissing(context, message.missing_request());
    case proto::Message::kReadRequest:
      return OnRead(context, message.read_request());
    case proto::Message::kSaveRolesRequest:
      return OnSaveRoles(context, message.save_roles_request());
    case proto::Message::kLoadRolesRequest:
      return OnLoadRoles(context);
    case proto::Message::kLeftOutReport:
      return store_->AddExcluded(context.sender().actor, message.left_out_report());
    case proto::Message::kPeerHave:
      return OnPeerHave(context, message.peer_have());
    case proto::Message::kControlRequest:
      return OnControlRequest(context, message);
    case proto::Message::kFindingsRequest:
      return OnFindings(context);
    case proto::Message::kPeerClock:
      return clock_.ObservePeer(message.peer_clock().peer(), message.peer_clock().utc_ns(), context.now());
    case proto::Message::kVerifyRequest:
      return OnVerify(context, message.verify_request());
    case proto::Message::kTimer:
      if (context.sender() != context.self()) return;
      if (message.timer().kind() == kScrub) Scrub(context);
      if (message.timer().kind() == kSaveWritten) SaveWritten(context);
      if (message.timer().kind() == kTend) Tend(context);
      if (message.timer().kind() == kTrimHistory) TrimHistory(context);
      return;
    case proto::Message::kPruneRequest:
      return OnPrune(context, message.prune_request());
    case proto::Message::kFingerprintRequest:
      return OnFingerprint(context, message.fingerprint_request());
    case proto::Message::kSaveBundleRequest:
    case proto::Message::kLoadBundlesRequest:
    case proto::Message::kReadBundleRequest:
    case proto::Message::kAckBundleRequest:
      return OnBundle(context, message);
    default:
      spdlog::debug("storage: ignored a message of kind {}", static_cast<int>(message.body_case()));
  }
}

void StorageActor::OnFromPeer(Context& context, const proto::Message& message) {
  const AgentId peer = context.sender().agent;
  if (!message.has_epoch_report() || FindAgent(options_.team, peer) == nullptr) {
    return spdlog::debug("storage: ignored a message of kind {} from agent {}", static_cast<int>(message.body_case()),
                         peer);
  }
  const Result<void> noted = store_->ObserveEpochReport(peer, message.epoch_report());
  if (!noted && noted.error().code == ErrorCode::kInvalid) {
    return rejected_log_.Warn("storage: rejected data from agent " + std::to_string(peer) + ": " +
                              OneLine(ToString(noted.error())));
  }
  if (!noted) Note(context, "a report of epochs", noted.error());
  PublishReissued(context);
}

void StorageActor::OnPeerEvent(Context& context, const proto::PeerEvent& event) {
  if (event.is_connected()) ReportEpochs(context, event.peer());
}

// Sends the peer an EpochReport: the epochs of the peer's own records that this store covers. Called whenever a link to
// the peer opens, so a lost report is repeated, and before records of the peer are returned to it.
void StorageActor::ReportEpochs(Context& context, AgentId peer) {
  proto::Message report;
  report.set_ms_type(proto::CONTROL);
  *report.mutable_epoch_report() = store_->ReportEpochs(peer);
  if (report.epoch_report().epochs().empty()) return;
  (void)context.Send({peer, actor_name::kStorage}, std::move(report));
}

void StorageActor::OnPeerHave(Context& context, const proto::PeerHave& note) {
  const Result<bool> noted = store_->ObservePeerHave(note);
  if (!noted) Note(context, "replication log", noted.error());
  if (noted && !*noted) {
    proto::Message request;
    request.mutable_peer_have_request()->set_peer(note.peer());
    Answer(context, std::move(request));
  }
  PublishReissued(context);
}

void StorageActor::OnInsert(Context& context, const proto::InsertRequest& request) {
  const bool has_map = std::any_of(request.records().begin(), request.records().end(),
                                   [](const proto::Record& record) { return record.has_local_traversability_map(); });
  RecordStore::Inserted inserted;
  const auto kind = has_map ? DiskGuard::Kind::kMap : DiskGuard::Kind::kRecord;
  if (const Result<void> room = CheckRoom(kind); !room) {
    *inserted.reply.mutable_error() = ToProto(room.error());
  } else {
    (void)IsClockSuspect(context);
    const auto marked = clock_.Mark(request, context.utc_now_ns(), context.now());
    inserted = InsertWhereRoomSeems(marked ? *marked : request);
  }
  if (IsError(inserted.reply.error())) FailIfDamaged(context, FromProto(inserted.reply.error()));
  proto::Message reply;
  *reply.mutable_insert_reply() = std::move(inserted.reply);
  Answer(context, std::move(reply));
  Publish(context, inserted.stored);
}

Result<void> StorageActor::CheckRoom(DiskGuard::Kind kind) {
  Result<void> room = disk_.CheckRoom(store_->database(), kind);
  if (!room && disk_.MakeRoomForLog(store_->database())) room = disk_.CheckRoom(store_->database(), kind);
  return room;
}

RecordStore::Inserted StorageActor::InsertWhereRoomSeems(const proto::InsertRequest& request) {
  RecordStore::Inserted inserted = store_->Insert(request);
  if (GivesUpReserveFor(inserted.reply.error())) inserted = store_->Insert(request);
  ObserveWrite(inserted.reply.error(), inserted.stored);
  return inserted;
}

RecordStore::Stored StorageActor::StoreWhereRoomSeems(const proto::StoreRequest& request) {
  RecordStore::Stored stored = store_->Store(request);
  if (GivesUpReserveFor(stored.reply.error())) stored = store_->Store(request);
  ObserveWrite(stored.reply.error(), stored.stored);
  return stored;
}

void StorageActor::OnStore(Context& context, const proto::StoreRequest& request) {
  RecordStore::Stored stored = StoreAsRoomAllows(request);
  for (const Error& rejection : stored.rejections) {
    rejected_log_.Warn("storage: rejected data from agent " + std::to_string(request.sender()) + ": " +
                       OneLine(ToString(rejection)));
  }
  if (IsError(stored.reply.error())) {
    failed_log_.Error("storage: did not store all records from agent " + std::to_string(request.sender()) + ": " +
                      stored.reply.error().text());
    FailIfDamaged(context, FromProto(stored.reply.error()));
  }
  proto::Message reply;
  *reply.mutable_store_reply() = std::move(stored.reply);
  Answer(context, std::move(reply));
  PublishReissued(context);
  Publish(context, stored.stored);
}

// Stores the records of the batch for which there is room. A nearly full disk has room for no other agent's maps, or
// for no maps. If a record is left out, replies with an error, which keeps the sender's session open until there is
// room again. This agent's have-set then covers the other records. If there is no room for any record, stores nothing
// and replies with an error.
RecordStore::Stored StorageActor::StoreAsRoomAllows(const proto::StoreRequest& request) {
  const auto is_map = [](const proto::StoredRecord& record) {
    return IsBulky(static_cast<DataType>(record.key().data_type()));
  };
  const bool has_map = std::any_of(request.records().begin(), request.records().end(), is_map);
  Result<void> room = CheckRoom(DiskGuard::Kind::kRecord);
  const Result<void> for_map = room && has_map ? CheckRoom(DiskGuard::Kind::kMap) : room;
  const Result<void> for_others_map = for_map && has_map ? CheckRoomForOthersMaps() : for_map;
  if (for_others_map) return StoreWhereRoomSeems(request);
  RecordStore::Stored stored;
  if (room) {
    proto::StoreRequest fitting = request;
    fitting.clear_records();
    for (const proto::StoredRecord& record : request.records()) {
      const bool is_own = record.key().origin_agent() == options_.self;
      const Result<void>& found = is_own ? for_map : for_others_map;
      if (found || !is_map(record)) {
        *fitting.add_records() = record;
      } else {
        room = found;
      }
    }
    stored = StoreWhereRoomSeems(fitting);
    if (room) return stored;
    stored.reply.Clear();
  }
  *stored.reply.mutable_error() = ToProto(room.error());
  return stored;
}

Result<void> StorageActor::CheckRoomForOthersMaps() {
  const Result<void> room = CheckRoom(DiskGuard::Kind::kOthersMap);
  return room ? store_->CheckRoomForOthersMaps() : room;
}

void StorageActor::OnMissing(Context& context, const proto::MissingRequest& request) {
  proto::Message message;
  Result<proto::MissingReply> reply = store_->GetMissing(request);
  if (reply) {
    if (HasRecordsOf(request.destination(), *reply)) ReportEpochs(context, request.destination());
    *message.mutable_missing_reply() = *std::move(reply);
  } else {
    Note(context, "cannot list missing records", reply.error());
    // Return no records and 1 remaining record, so the session asks again.
    message.mutable_missing_reply()->set_remaining(1);
  }
  Answer(context, std::move(message));
  PublishReissued(context);
}

void StorageActor::OnRead(Context& context, const proto::ReadRequest& request) {
  proto::Message message;
  Result<proto::ReadReply> reply = store_->Read(request);
  if (reply) {
    *message.mutable_read_reply() = *std::move(reply);
  } else {
    FailIfDamaged(context, reply.error());
    *message.mutable_read_reply()->mutable_error() = ToProto(reply.error());
  }
  Answer(context, std::move(message));
}

void StorageActor::OnSaveRoles(Context& context, const proto::SaveRolesRequest& request) {
  proto::Message reply;
  proto::SaveRolesReply& body = *reply.mutable_save_roles_reply();
  const Result<proto::RecordsStored> saved = WriteInAnyCase([&] { return store_->SaveRoles(request); });
  if (!saved) {
    FailIfDamaged(context, saved.error());
    *body.mutable_error() = ToProto(saved.error());
  }
  Answer(context, std::move(reply));
  if (!saved) return;
  copies_.ObserveRoles(request.roles());
  Publish(context, *saved);
}

// A full disk may lack the few pages that are needed to move the log into the file. All writes then fail, although the
// file has room.
bool StorageActor::GivesUpReserveFor(const proto::Error& error) {
  return error.code() == proto::ERROR_CODE_FULL && options_.bytes_max == 0 && disk_.GiveUpReserve(store_->database());
}

template <typename Write>
auto StorageActor::WriteInAnyCase(Write write) -> decltype(write()) {
  auto done = write();
  if (!done && GivesUpReserveFor(ToProto(done.error()))) done = write();
  ObserveWrite(done ? Result<void>() : tl::unexpected(done.error()));
  if (!done && done.error().code == ErrorCode::kFull) done.error().text += "; " + disk_.Advice();
  return done;
}

void StorageActor::ObserveWrite(const Result<void>& written) {
  if (written) {
    if (disk_.ObserveSuccess()) spdlog::info("storage: the disk accepts writes again");
  } else if (disk_.ObserveFailure(store_->database(), written.error())) {
    trouble_log_.Error("storage: nothing can be written: " + disk_.trouble() +
                       "; stored records are still read and shared");
  }
}

// Notes the result of storing records. Ignores errors that do not come from the disk, and requests that stored no row,
// because neither shows whether the disk works.
void StorageActor::ObserveWrite(const proto::Error& error, const proto::RecordsStored& stored) {
  if (IsError(error)) return ObserveWrite(tl::unexpected(FromProto(error)));
  if (stored.last_row_id() != 0) ObserveWrite(Result<void>());
}

void StorageActor::OnLoadRoles(Context& context) {
  Result<proto::LoadRolesReply> loaded = store_->LoadRoles();
  if (!loaded) {
    // Fail, because acting without known roles would be worse than a restart.
    context.Fail(loaded.error());
    return;
  }
  if (!loaded->history().empty()) copies_.ObserveRoles(*loaded->history().rbegin());
  proto::Message reply;
  *reply.mutable_load_roles_reply() = *std::move(loaded);
  Answer(context, std::move(reply));
}

void StorageActor::OnControlRequest(Context& context, const proto::Message& message) {
  const Result<proto::ControlRequest> request = ControlRequestOf(message);
  if (request && request->has_status()) OnStatus(context);
}

void StorageActor::OnStatus(Context& context) {
  const std::int64_t utc_ns = context.utc_now_ns();
  Result<proto::StorageStatus> status = store_->GetStatus(DayOf(utc_ns));
  if (!status) Note(context, "status", status.error());
  (void)IsClockSuspect(context);
  proto::ControlReply reply;
  proto::StorageStatus& shown = *reply.mutable_status()->mutable_storage();
  if (status) {
    shown = *std::move(status);
    disk_.Describe(store_->database(), shown);
    shown.set_space_low(SpaceLow(shown));
  }
  const Result<void> counted = copies_.Describe(*store_, context.now(), shown);
  if (!counted) Note(context, "status", counted.error());
  clock_.Describe(utc_ns, context.now(), shown);
  shown.set_set_aside(options_.set_aside);
  shown.set_database_bytes_max(options_.team.retention().store_mb_max() * kMegabyte);
  store_->DescribeRefused(*reply.mutable_status());
  Answer(context, MessageOf(reply));
}

void StorageActor::OnFindings(Context& context) {
  const Result<std::vector<proto::HealthFinding>> findings = store_->Findings();
  if (!findings) Note(context, "findings", findings.error());
  proto::ControlReply reply;
  proto::AgentStatus& status = *reply.mutable_status();
  if (findings) *status.mutable_findings() = {findings->begin(), findings->end()};
  Answer(context, MessageOf(reply));
}

std::string StorageActor::SpaceLow(const proto::StorageStatus& status) const {
  const proto::RetentionConfig& retention = options_.team.retention();
  const double free_min = retention.disk_free_mb_min() * kMegabyte;
  const bool has_disk = options_.vfs.empty() && store_->database().GetDiskSpace().has_value();
  if (has_disk && status.disk_free_bytes() < free_min) {
    return Megabytes(status.disk_free_bytes()) + " of disk are free, less than the " + Megabytes(free_min) +
           " of retention.disk_free_mb_min";
  }
  const double budget = retention.store_mb_max() * kMegabyte;
  // RetentionActor prunes the store to below this part. If the store takes more, too few records could be removed.
  if (budget > 0 && status.database_bytes() - status.wal_bytes() > kOthersMapsPartMax * budget) {
    return "the store takes " + Megabytes(status.database_bytes() - status.wal_bytes()) + " of the " +
           Megabytes(budget) + " of retention.store_mb_max, and no more records may be removed yet" +
           (store_->CheckRoomForOthersMaps() ? "" : "; no more maps of other agents are accepted");
  }
  return "";
}

// Executes a prune. If this agent's clock is suspect, removes no record by age.
void StorageActor::OnPrune(Context& context, const proto::PruneRequest& request) {
  proto::Message message;
  proto::PruneReply& reply = *message.mutable_prune_reply();
  if (request.older_than_s() > 0 && IsClockSuspect(context)) {
    reply.set_text("this agent's clock is suspect, so no records are removed by age: " + clock_.suspect());
    reply.set_is_complete(true);
    return Answer(context, std::move(message));
  }
  Result<proto::PruneReply> pruned = store_->Prune(request, context.utc_now_ns());
  if (!pruned && pruned.error().code == ErrorCode::kFull) {
    pruned = WriteInAnyCase([&] { return store_->Prune(request, context.utc_now_ns(), kRowsOnFullDisk); });
  } else if (pruned && !pruned->pruned().empty() && !request.is_dry_run()) {
    ObserveWrite(Result<void>());
  }
  if (pruned) {
    reply = *std::move(pruned);
    proto::RecordsStored changed;
    changed.set_is_pruned(!reply.pruned().empty() && !request.is_dry_run() && !request.is_history());
    Publish(context, changed);
  } else {
    Note(context, "prune", pruned.error());
    *reply.mutable_error() = ToProto(pruned.error());
  }
  Answer(context, std::move(message));
}

// Periodically checks the file, its disk and the reserve, which can change without a message.
void StorageActor::Tend(Context& context) {
  copies_.ObserveTime(context.now(), store_->next_row_id());
  if (const Result<void> there = store_->database().CheckInPlace(); !there) return Note(context, "", there.error());
  const bool is_writable = store_->database().access() != Database::Access::kReadOnly;
  if (!is_writable && !store_->database().IsOnReadOnlyFileSystem()) return Reopen(context);
  if (is_writable && !disk_.trouble().empty()) {
    const Result<void> written = store_->TryToWrite();
    ObserveWrite(written);
    if (!written) FailIfDamaged(context, written.error());
    // Reopen the store, so that other processes can read the file again.
    const bool is_alone = store_->database().access() == Database::Access::kAlone && options_.vfs.empty();
    if (written && is_alone) return Reopen(context);
  }
  if (is_writable) DropHistoryWhereShort(disk_, *store_);
  const bool is_reserve_growing = disk_.Tend(store_->database(), context.rng());
  (void)context.AfterTimer(is_reserve_growing ? options_.reserve_pause : options_.tend_period, kTend);
}

// Reopens the store. Its rows are the same, so other actors need no restart.
void StorageActor::Reopen(Context& context) {
  spdlog::info("storage: the disk can be written again; reopens {}", options_.path);
  store_.reset();
  disk_.ObserveSuccess();
  if (OpenStore(context)) (void)context.AfterTimer(options_.tend_period, kTend);
}

void StorageActor::SaveWritten(Context& context) {
  if (disk_.trouble().empty()) {
    const Result<void> saved = store_->SaveWritten(DayOf(context.utc_now_ns()));
    if (!saved) Note(context, "bytes written", saved.error());
  }
  (void)context.AfterTimer(options_.written_period, kSaveWritten);
}

// Removes history rows by age, and rows that exceed a lowered limit. If this agent's clock is suspect, removes no row
// by age.
void StorageActor::TrimHistory(Context& context) {
  const bool tells_time = !IsClockSuspect(context);
  const Result<bool> has_more =
      store_->TrimHistory(tells_time ? std::optional<std::int64_t>(context.utc_now_ns()) : std::nullopt);
  if (!has_more) Note(context, "history", has_more.error());
  const bool goes_on = has_more && *has_more;
  (void)context.AfterTimer(goes_on ? options_.history_pause : options_.history_period, kTrimHistory);
}

// Verifies a part of the store for an operator. Reports damage, but does not repair it.
void StorageActor::OnVerify(Context& context, const proto::VerifyRequest& request) {
  proto::Message message;
  Result<proto::VerifyReply> reply = store_->Verify(request);
  if (reply) {
    *message.mutable_verify_reply() = *std::move(reply);
  } else {
    *message.mutable_verify_reply()->mutable_error() = ToProto(reply.error());
  }
  Answer(context, std::move(message));
}

void StorageActor::OnFingerprint(Context& context, const proto::FingerprintRequest& request) {
  proto::Message message;
  Result<proto::FingerprintReply> reply = store_->TakeFingerprint(request);
  if (reply) {
    *message.mutable_fingerprint_reply() = *std::move(reply);
  } else {
    *message.mutable_fingerprint_reply()->mutable_error() = ToProto(reply.error());
  }
  Answer(context, std::move(message));
}

void StorageActor::OnBundle(Context& context, const proto::Message& message) {
  proto::Message reply;
  const auto answer = [&](const auto& done, auto& body) {
    if (done) return Answer(context, std::move(reply));
    FailIfDamaged(context, done.error());
    *body.mutable_error() = ToProto(done.error());
    Answer(context, std::move(reply));
  };
  if (message.has_save_bundle_request()) {
    return answer(store_->SaveBundle(message.save_bundle_request()), *reply.mutable_save_bundle_reply());
  }
  if (message.has_ack_bundle_request()) {
    const std::uint32_t number = message.ack_bundle_request().number();
    return answer(store_->AcknowledgeBundle(number), *reply.mutable_ack_bundle_reply());
  }
  if (message.has_read_bundle_request()) {
    Result<proto::ReadBundleReply> part = store_->ReadBundle(message.read_bundle_request());
    if (part) *reply.mutable_read_bundle_reply() = *std::move(part);
    return answer(part, *reply.mutable_read_bundle_reply());
  }
  Result<proto::LoadBundlesReply> bundles = store_->LoadBundles();
  if (bundles) *reply.mutable_load_bundles_reply() = *std::move(bundles);
  answer(bundles, *reply.mutable_load_bundles_reply());
}

// Verifies the next part of the store: first the rows in parts, then the held seqs, then the whole file.
void StorageActor::Scrub(Context& context) {
  const Result<proto::VerifyReply> reply = store_->Verify(next_scrub_);
  if (!reply) {
    Note(context, "cannot verify the store", reply.error());
    (void)context.AfterTimer(options_.scrub_period, kScrub);
    return;
  }
  for (const proto::VerifyFinding& finding : reply->findings()) {
    const std::string which = finding.has_key() ? ToString(FromProto(finding.key())) + ": " : "";
    const Error damage{ErrorCode::kCorrupt, which + finding.text(), ""};
    // Other agents do not have this agent's local records, so a restart could not repair a damaged local record.
    const bool is_local = finding.has_key() && finding.key().seq() == 0;
    if (!is_local) return Note(context, "verification of the store", damage);
    spdlog::error("storage: a local record is damaged: {}", ToString(damage));
  }
  (void)context.AfterTimer(MoveScrubOn(*reply) ? options_.scrub_period : options_.scrub_pause, kScrub);
}

bool StorageActor::MoveScrubOn(const proto::VerifyReply& reply) {
  if (!reply.is_complete()) {
    next_scrub_.set_after_row_id(reply.last_row_id());
    *next_scrub_.mutable_after_key() = reply.last_key();
    return false;
  }
  const proto::VerifyPart done = next_scrub_.part();
  next_scrub_.Clear();
  next_scrub_.set_part(done == proto::VERIFY_PART_ROWS   ? proto::VERIFY_PART_HELD
                       : done == proto::VERIFY_PART_HELD ? proto::VERIFY_PART_FILE
                                                         : proto::VERIFY_PART_ROWS);
  return done == proto::VERIFY_PART_FILE;
}

// Logs that this disk was replaced or restored, and publishes the states that were therefore stored again.
void StorageActor::PublishReissued(Context& context) {
  if (store_->TakeLearnedEpochs()) {
    proto::InsertRequest request;
    *request.add_records() = MakeEvent(proto::EVENT_KIND_DAMAGE, kDiskReplaced, "", context.utc_now_ns());
    Publish(context, store_->Insert(request).stored);
  }
  const proto::RecordsStored reissued = store_->TakeReissued();
  if (reissued.last_row_id() == 0) return;
  reissued_log_.Info("storage: a peer knows a later epoch of this agent, from a lost or restored disk: newest " +
                     std::string("states are stored again"));
  Publish(context, reissued);
}

bool StorageActor::IsClockSuspect(Context& context) {
  if (clock_.Judge(context.utc_now_ns(), context.now())) {
    proto::Message jumped;
    jumped.set_ms_type(proto::CONTROL);
    jumped.mutable_clock_jumped();
    (void)context.Send({options_.self, actor_name::kClock}, std::move(jumped));
  }
  return !clock_.suspect().empty();
}

void StorageActor::Answer(Context& context, proto::Message reply) {
  const SendResult sent = context.Reply(std::move(reply));
  if (sent != SendResult::kAccepted) {
    reply_log_.Warn("storage: reply to " + ToString(context.sender()) + ": " + ToString(sent));
  }
}

void StorageActor::Note(Context& context, const char* what, const Error& error) {
  const std::string line = "storage: " + std::string(what) + (*what == 0 ? "" : ": ") + ToString(error);
  if (error.code == ErrorCode::kCorrupt) {
    spdlog::error("{}", line);  // Logged only once, because the process ends.
  } else {
    failed_log_.Error(line);
  }
  FailIfDamaged(context, error);
}

// If the store is damaged, makes this actor fail, and the Supervisor ends the process. The next process checks the
// whole file, and repairs or replaces it. This process cannot do so, because other actors have read rows that would
// then be missing.
void StorageActor::FailIfDamaged(Context& context, const Error& error) {
  if (error.code == ErrorCode::kCorrupt) context.Fail(error);
}

void StorageActor::Publish(Context& context, const proto::RecordsStored& stored) {
  if (stored.last_row_id() == 0 && !stored.is_pruned()) return;
  proto::Message message;
  *message.mutable_records_stored() = stored;
  context.Publish(std::move(message));
}

}  // namespace moondb
