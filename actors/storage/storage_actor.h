// StorageActor: the only owner of an agent's database. It answers the requests of proto/storage.proto, retention.proto
// and downlink.proto, and the ControlRequest `status` with its part of AgentStatus.
//
// The actor accepts only EpochReport from peers. When a link opens, each side reports which epochs of the other agent's
// own records it knows. An agent whose disk was lost or restored thus learns of its later epochs.
//
// Each reply is sent after the commit that it reports. If a write fails, the reply contains the error and the actor
// continues. If the file cannot be opened, the actor fails. The process ends if the file is found damaged, or if
// another program removed, moved, replaced or truncated the file. The actor checks the whole store periodically
// (Options::scrub_period), to detect damage while another disk still holds the lost records.
//
// If the disk is nearly full, the actor first refuses maps, then all records, of its own robot and of peers
// (actors/storage/disk_guard.h). While only maps are refused, the actor stores the other records of a peer's batch and
// replies with an error. The sender retries the maps with a growing delay. Role assignments and prunes are stored as
// long as the disk accepts any write, and the reserve is given up for them.
//
// Records whose age is unknown are marked (actors/storage/record_clock.h). Spawn this actor with its own thread,
// because commits wait for the disk.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "actors/storage/copy_watch.h"
#include "actors/storage/disk_guard.h"
#include "actors/storage/record_clock.h"
#include "actors/storage/record_store.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/rate_limited_log.h"

namespace moondb {

class StorageActor final : public Actor {
 public:
  struct Options {
    std::string path;  // The database file. Its folder must exist. ":memory:" for tests.
    // VFS name, as for Database::Open. Empty for the operating system's files.
    std::string vfs;
    AgentId self = 0;  // This agent. It must be in `team`.
    // The validated team configuration. The actor reads its agents, `share` policies, custom types and `retention`.
    proto::TeamConfig team;
    std::uint64_t bytes_max = 0;  // Size limit of the file; 0: limited by the disk only.
    // Time between two saves of the count of bytes written.
    Duration written_period = std::chrono::minutes(1);
    // Time from the end of one scrub to the start of the next; zero disables scrubs.
    Duration scrub_period = std::chrono::hours(24);
    // Pause between two parts of a scrub. A part reads at most kVerifyBytesMax.
    Duration scrub_pause = std::chrono::minutes(1);
    // Time between two checks of the file, its disk and the reserve.
    Duration tend_period = std::chrono::seconds(10);
    // Pause between writing two parts of the reserve. During the pause the disk is free for inserts.
    Duration reserve_pause = std::chrono::milliseconds(500);
    // Time between two checks whether history has rows to remove.
    Duration history_period = std::chrono::minutes(1);
    // Pause between two parts of a history trim. A part removes at most kHistoryTrimRowsMax rows.
    Duration history_pause = std::chrono::seconds(1);
    // Path of the damaged file that was set aside at the start of this process; empty if there was none. Shown in the
    // status.
    std::string set_aside;
    // Returns the UTC time at which the process began to stop in an orderly way; null if it did not. Called when the
    // actor ends. The actor logs this time as the last event of the store.
    std::function<std::optional<std::int64_t>()> stopped_at_ns;
    // Signs this agent's own map quarantines; see RecordStore::Options.
    std::function<std::string(const RecordKey&, const proto::Record&)> sign;
    // True if this process opened the file before. A restart of the actor then skips the check of the whole file.
    bool is_checked = false;
  };

  explicit StorageActor(Options options);
  ~StorageActor() override;

  // Returns options with which a program can open the same store before the actor runs, to show an error at its start.
  static RecordStore::Options StoreOptions(const Options& options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  void OnFromPeer(Context& context, const proto::Message& message);
  void OnPeerEvent(Context& context, const proto::PeerEvent& event);
  void ReportEpochs(Context& context, AgentId peer);
  void OnPeerHave(Context& context, const proto::PeerHave& note);
  void OnInsert(Context& context, const proto::InsertRequest& request);
  void OnStore(Context& context, const proto::StoreRequest& request);
  void OnMissing(Context& context, const proto::MissingRequest& request);
  void OnRead(Context& context, const proto::ReadRequest& request);
  void OnSaveRoles(Context& context, const proto::SaveRolesRequest& request);
  void OnLoadRoles(Context& context);
  void OnControlRequest(Context& context, const proto::Message& message);
  void OnStatus(Context& context);
  void OnFindings(Context& context);
  void OnPrune(Context& context, const proto::PruneRequest& request);
  void OnVerify(Context& context, const proto::VerifyRequest& request);
  void OnFingerprint(Context& context, const proto::FingerprintRequest& request);
  void OnBundle(Context& context, const proto::Message& message);  // Handles all requests about bundles.
  void Scrub(Context& context);
  bool OpenStore(Context& context);
  void Tend(Context& context);
  void Reopen(Context& context);
  Result<void> CheckRoom(DiskGuard::Kind kind);
  Result<void> CheckRoomForOthersMaps();  // Checks the disk and the store's budget.
  // Call these two functions after CheckRoom found room. If the disk is full nevertheless, both functions give up the
  // reserve and retry once.
  RecordStore::Inserted InsertWhereRoomSeems(const proto::InsertRequest& request);
  RecordStore::Stored StoreWhereRoomSeems(const proto::StoreRequest& request);
  // Gives up the reserve after a failed write. Returns true if this freed space; the caller should then retry once.
  bool GivesUpReserveFor(const proto::Error& error);
  // Calls `write`. If the disk is full, gives up the reserve and calls `write` once more.
  template <typename Write>
  auto WriteInAnyCase(Write write) -> decltype(write());
  void ObserveWrite(const Result<void>& written);
  void ObserveWrite(const proto::Error& error, const proto::RecordsStored& stored);
  RecordStore::Stored StoreAsRoomAllows(const proto::StoreRequest& request);
  void SaveWritten(Context& context);
  void TrimHistory(Context& context);
  // Returns a text for people that explains why little space is left; empty if there is enough space.
  std::string SpaceLow(const proto::StorageStatus& status) const;
  // Advances `next_scrub_` past what `reply` covers. Returns true if the scrub of the whole store is then complete.
  bool MoveScrubOn(const proto::VerifyReply& reply);
  void Answer(Context& context, proto::Message reply);
  void Note(Context& context, const char* what, const Error& error);
  void FailIfDamaged(Context& context, const Error& error);
  void Publish(Context& context, const proto::RecordsStored& stored);
  void PublishReissued(Context& context);
  // Judges the clock. Returns whether it is suspect.
  bool IsClockSuspect(Context& context);

  const Options options_;
  RecordClock clock_;
  CopyWatch copies_;
  std::unique_ptr<RecordStore> store_;
  proto::VerifyRequest next_scrub_;
  DiskGuard disk_;
  RateLimitedLog rejected_log_;
  RateLimitedLog failed_log_;
  RateLimitedLog trouble_log_;
  RateLimitedLog reply_log_;
  RateLimitedLog reissued_log_;
};

}  // namespace moondb
