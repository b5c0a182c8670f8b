// StorageActor: the one owner of an agent's database; answers what proto/storage.proto, retention.proto and
// downlink.proto let others ask, and the ControlRequest `status` with its part of AgentStatus.
//
// From peers it hears one thing, EpochReport: when a link comes up, each side says which epochs of the other's own
// records it knows, so that an agent whose disk was lost or restored hears of them at once. An agent whose actor alone
// was made anew hears of them with the next link or session.
//
// Thin: RecordStore does the work. Every reply comes after the commit that it speaks of. A failed write is an error in
// its reply, and the actor goes on; a file that cannot be opened fails the actor, and one that turns out to be damaged,
// or to be removed, moved, replaced or cut by somebody else, ends the process. So that damage is noticed while another
// disk still has what it costs, it reads through the whole store now and then (Options::scrub_period), as a process
// does at its start. Marks what is inserted while this agent's clock is suspect. Spawn it with a thread of its own:
// commits wait for the disk.
//
// On a disk that is nearly full it refuses maps, then every record (actors/storage/disk_guard.h), its own robot's and
// peers' (of a peer's batch it stores what is no map, and answers with an error all the same: the sender keeps the rest
// and comes back after its growing delay). Roles and prunes are stored as long as the disk takes anything, with the
// reserve given up for them. A store that had to be opened without writing is opened anew when the disk works again.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "actors/storage/clock_judge.h"
#include "actors/storage/disk_guard.h"
#include "actors/storage/record_store.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/rate_limited_log.h"

namespace moondb {

class StorageActor final : public Actor {
 public:
  struct Options {
    std::string path;             // The database file; its folder exists. ":memory:" for tests.
    std::string vfs;              // Empty: the system's files. Else as of Database::Open.
    AgentId self = 0;             // This agent, which is in `team`.
    proto::TeamConfig team;       // Checked; its agents, policies `share`, custom types and `retention` are read.
    std::uint64_t bytes_max = 0;  // Of the file; 0: as the disk allows.
    Duration written_period = std::chrono::minutes(1);  // Between two times of writing down what was written.
    Duration scrub_period = std::chrono::hours(24);     // From the end of a reading to the next one; zero: never.
    Duration scrub_pause = std::chrono::minutes(1);     // Between two parts of one, each kVerifyBytesMax at most.
    Duration tend_period = std::chrono::seconds(10);    // Between two looks at the file, its disk and the reserve.
    Duration reserve_pause = std::chrono::milliseconds(500);  // Between two parts of the reserve while it is made,
                                                              // which leaves the disk to inserts meanwhile.
    Duration history_period = std::chrono::minutes(1);        // Between two looks at what is kept for a time only,
    Duration history_pause = std::chrono::seconds(1);  // and between two parts of one, kHistoryTrimRowsMax at most.
    std::string set_aside;  // The damaged file that this process's start set aside; shown in status.
    // When the process began to end in order, UTC; none: it does not end, or not in order. Asked as the actor ends,
    // which then writes it down as the store's last event.
    std::function<std::optional<std::int64_t>()> stopped_at_ns;
    // As RecordStore::Options.
    std::function<std::string(const RecordKey&, const proto::Record&)> sign;
    bool is_checked = false;  // As RecordStore::Options: the actor's restarts take no longer for a large file.
  };

  explicit StorageActor(Options options);
  ~StorageActor() override;

  // The same store as the actor's, for a check at a program's start: open it, show the error, close it again.
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
  void OnBundle(Context& context, const proto::Message& message);  // Any question about one.
  void Scrub(Context& context);
  bool OpenStore(Context& context);
  void Tend(Context& context);
  void Reopen(Context& context);
  Result<void> CheckRoom(DiskGuard::Kind kind);
  // Both write after DiskGuard found room. If the disk is full all the same, they give up the reserve and try again.
  RecordStore::Inserted InsertWhereRoomSeems(const proto::InsertRequest& request);
  RecordStore::Stored StoreWhereRoomSeems(const proto::StoreRequest& request);
  // After a write failed: whether it is worth another attempt.
  bool GivesUpReserveFor(const proto::Error& error);
  // Does it; where the disk is full, once more with the reserve given up for it.
  template <typename Write>
  auto WriteInAnyCase(Write write) -> decltype(write());
  void NoteWrite(const Result<void>& written);
  void NoteWrite(const proto::Error& error, const proto::RecordsStored& stored);
  RecordStore::Stored StoreAsRoomAllows(const proto::StoreRequest& request);
  void SaveWritten(Context& context);
  void TrimHistory(Context& context);
  // Why there is little room left; empty: there is enough.
  std::string SpaceLow(const proto::StorageStatus& status) const;
  bool MoveScrubOn(const proto::VerifyReply& reply);  // Whether that was the last part.
  void Answer(Context& context, proto::Message reply);
  void Note(Context& context, const char* what, const Error& error);
  void FailIfDamaged(Context& context, const Error& error);
  void Publish(Context& context, const proto::RecordsStored& stored);
  void PublishReissued(Context& context);
  // Whether what is inserted now must be marked.
  bool IsClockSuspect(Context& context);

  const Options options_;
  ClockJudge clock_judge_;
  std::string clock_suspect_;  // The last verdict.
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
