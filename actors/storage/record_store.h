// RecordStore: everything that an agent keeps, in one SQLite file: records, what was had of which stream, roles, and
// what peers have (paper, Sections 3 and 4).
//
// Records are immutable and named by (origin, epoch, data type, seq). Each call that writes is one transaction; when
// it fails, file and memory are as before and the store goes on. Rules:
// - An epoch begins at the first shared insert of a process, above every own epoch known here
//   (actors/storage/own_epochs.h), so that a lost or restored disk never uses a name twice. Where a peer turns out to
//   know a later own epoch (this disk was lost), the present one is closed, and what is written next begins one above
//   it; an epoch that is thousands of lives ahead is refused.
// - The newest states of epochs that such a later one cannot have known are *restated*: stored once more, as
//   states, under an epoch above all known ones, in one transaction and before any row of the later epoch. So an older
//   state that comes home never replaces a newer one. Where that fails nothing is stored, and it is done again.
// - seqs have no gap within (epoch, type): they are allocated in the transaction that stores their rows.
// - Under the policy `latest` a state (Record.is_state) supersedes the older states of its (origin, type, latest key):
//   older by (epoch, seq), and of optimized poses and verdicts by their term and run before that (RecordOrder). Their
//   rows go, and their seqs become dropped, in the transaction that stores the newer one. A state that comes after its
//   superseder, or is inserted below it, is dropped at once. A record that its origin stored under `all` supersedes
//   nothing and is never superseded. Each new state costs a look at all records of its key.
// - Of this agent's own records what is superseded moves into its history, as far as that keeps it
//   (actors/storage/history.h); when the file or the disk is full, history goes first.
// - A custom type must be declared for own inserts alone: peers' records of any custom type are carried
//   (actors/storage/sharing_rules.h), and a type that is no longer declared keeps its rows.
// - A peer's drops are taken for `latest` and carried types only, and only where something newer of that origin
//   and type is held here (anything of it, for poses and verdicts, whose order a drop does not tell); a row that is the
//   newest of its key stays until its superseder comes. Batches may overtake each other, and what would have replaced
//   it may be lost for ever with its only disk.
// - What was pruned (actors/storage/prune.h) counts as held and dropped: it is never fetched again, and the drop stays
// here,
//   since drops travel for `latest` and carried types only. Should this disk be lost, what others still hold comes
//   back. A node or edge that was pruned and is inserted again is a new record.
//
// From one thread at a time. Not moved, not copied: Open gives a pointer.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "actors/storage/findings.h"
#include "actors/storage/have_ledger.h"
#include "actors/storage/history.h"
#include "actors/storage/missing_records.h"
#include "actors/storage/own_epochs.h"
#include "actors/storage/peer_authority.h"
#include "actors/storage/peer_log.h"
#include "actors/storage/record_tables.h"
#include "actors/storage/sharing_rules.h"
#include "actors/storage/sqlite_database.h"
#include "actors/storage/write_count.h"
#include "proto/downlink.pb.h"
#include "proto/retention.pb.h"
#include "proto/sharing.pb.h"
#include "proto/storage.pb.h"

namespace moondb::proto {
class AgentStatus;
class StorageStatus;
}  // namespace moondb::proto

namespace moondb {

class RecordStore {
 public:
  struct Options {
    std::string path;        // The file; its folder exists. ":memory:" for tests.
    std::string vfs;         // As of Database::Open.
    AgentId self = 0;        // Whose store this is. A file remembers it.
    std::set<AgentId> team;  // All agents, this one too. Records from or about others are refused.
    // Of sharing, by built-in type; those without one are not shared.
    SharingRules::Policies policies;
    CustomTypes custom_types;       // Of the team file, complete.
    std::set<DataType> for_ground;  // As SharingRules has it.
    std::uint64_t seed = 0;         // Of the epochs' random bits.
    std::uint64_t bytes_max = 0;    // Of the file; 0: as the disk allows.
    // When the tables take so much no own map is taken (kFull), so that maps leave room for states; 0: no limit.
    std::uint64_t map_store_bytes_max = 0;
    bool is_checked = false;           // This process opened it before: it is not read through again (1 ms a MB).
    History::Rules history;            // What of own superseded records is kept; by default nothing.
    PeerAuthority::Options authority;  // Whose word is taken; `self` and `team` are filled in. By default everybody's.
    // This agent's signature of an own record that anybody may bring; none in a team without signing keys.
    std::function<std::string(const RecordKey&, const proto::Record&)> sign;
  };

  // Opens, reads through and where needed creates the file. A damaged one is set aside and an empty one
  // begun, in a new epoch: peers fill it again with what they have. A shared record whose content is not what its hash
  // says, or that is gone, is held no more, so that peers send it again. A file of ours opens on a disk that is full,
  // fails or is read-only, too, unless it has to be mended: the reserve is given up for it, and what a start writes
  // down for people waits for a later one. kRefused, and the file is not touched: of another
  // store version, of another program or another agent (schema.h).
  // kUnavailable: in use by another process. kFull, kInternal, kCorrupt: as it says.
  static Result<std::unique_ptr<RecordStore>> Open(Options options);
  // Why the start could not write what it wanted to; empty: it could, or had nothing to write.
  const std::optional<Error>& start_trouble() const { return start_trouble_; }
  // Where a damaged file was set aside when this one was opened; else empty.
  const std::string& set_aside() const { return set_aside_; }
  // What this opening found damaged, a line each; empty: nothing.
  const std::vector<std::string>& damage() const { return damage_; }

  // Once, as a process starts and before its actors run: writes down, as events, what this opening found damaged and
  // whether the process before ended without stopping. A damaged file that an opening set aside which came to nothing
  // more is found, too: nobody has written down anything in the store that followed it.
  Result<void> LogLastRun(std::int64_t utc_now_ns);
  // As a process ends that was asked to, after all else: so that the next one finds nothing to write down.
  Result<void> WriteDownStop(std::int64_t utc_now_ns);
  // As in actors/storage/findings.h.
  Result<std::vector<proto::HealthFinding>> Findings();

  // Own records: all of them, or none and an error. A second record of one natural key (node, edge) with the same
  // content gives the first one's key; with other content it is kInvalid.
  struct Inserted {
    proto::InsertReply reply;
    proto::RecordsStored stored;  // last_row_id 0: no new row.
  };
  Inserted Insert(const proto::InsertRequest& request);

  // Records of any origin, from a peer: each is checked and stored or rejected on its own; a failing transaction
  // stores none. When this returns without error, what `reply.had` says survives a power cut; it is larger than a page
  // of a have-set only where it has an interval for each of so many records.
  struct Stored {
    proto::StoreReply reply;
    proto::RecordsStored stored;
    std::vector<Error> rejections;  // The first few, for the log.
    // Records that their origin may not state. `reply.had` covers them, so that the session does not send them again;
    // the store's own have-set does not.
    std::vector<RecordKey> never_valid;
  };
  Stored Store(const proto::StoreRequest& request);

  proto::HaveReply GetHave(const proto::HaveRequest& request = {}) const;

  // What a peer says of this agent's own epochs: at most kEpochReportMax, rising, none 0; else kInvalid, and none is
  // heard. One that cannot be is passed over and counted as rejected.
  Result<void> NoteEpochReport(AgentId peer, const proto::EpochReport& report);
  // The highest epochs of `origin` of which anything was had, for that agent itself.
  proto::EpochReport ReportEpochs(AgentId origin) const;
  static constexpr int kEpochReportMax = 64;
  // What was restated since the last call, in whichever call that was.
  proto::RecordsStored TakeReissued();

  // Errors: kInvalid for a malformed have-set, else as Database.
  Result<proto::MissingReply> GetMissing(const proto::MissingRequest& request);
  // A page of what is held, or with is_history of what this agent's own robot has superseded.
  Result<proto::ReadReply> Read(const proto::ReadRequest& request);
  // What an agent acts on from now on, durably, after what that follows. One in which this agent leads or survives is
  // stored as a record of its own too, with what it follows and nobody's record holds: whoever it brings other agents'
  // records to must know that it may.
  Result<proto::RecordsStored> SaveRoles(const proto::SaveRolesRequest& request);
  // As PeerAuthority::NoteLeftOut.
  void NoteLeftOut(const std::string& reader, const proto::LeftOutReport& report) {
    authority_.NoteLeftOut(reader, report);
  }
  // What peers sent and was refused, by peer.
  void DescribeRefused(proto::AgentStatus& status) const { authority_.Describe(ledger_.have(), status); }
  Result<proto::LoadRolesReply> LoadRoles();
  // As PeerLog::Note.
  Result<bool> NotePeerHave(const proto::PeerHave& note);
  // `day` is today, since 1970, for the bytes written.
  Result<proto::StorageStatus> GetStatus(std::uint32_t day = 0);
  // Once a minute: what was written to the disk is written down, if anything was.
  Result<void> SaveWritten(std::uint32_t day) { return write_count_.Save(*database_, day); }

  // Removes rows, or counts those that would go; durable when this returns. At most `rows_max` of them: on a full disk
  // what a few need is there. Errors as ChooseToPrune has them.
  Result<proto::PruneReply> Prune(const proto::PruneRequest& request, std::int64_t utc_now_ns,
                                  std::size_t rows_max = SIZE_MAX);
  // Writes what is there already: whether the disk takes it.
  Result<void> TryToWrite();
  // Now and then: lets superseded states go that are kept for a time only, some at a time; true where more may go.
  // None: this agent cannot tell the time.
  Result<bool> TrimHistory(std::optional<std::int64_t> utc_now_ns);
  // Where space is short: removes the oldest superseded states until so many bytes are free within the file, or none is
  // left; how many were freed. Durable when this returns.
  Result<std::uint64_t> DropHistory(std::uint64_t bytes);
  // As in actors/storage/verify.h.
  Result<proto::VerifyReply> Verify(const proto::VerifyRequest& request);
  Result<proto::FingerprintReply> TakeFingerprint(const proto::FingerprintRequest& request);

  // As in actors/storage/bundle_shelf.h.
  Result<void> SaveBundle(const proto::SaveBundleRequest& request);
  Result<proto::LoadBundlesReply> LoadBundles();
  Result<proto::ReadBundleReply> ReadBundle(const proto::ReadBundleRequest& request);
  Result<void> AcknowledgeBundle(std::uint32_t number);

  // For tests and tools that look into the tables.
  Database& database() { return *database_; }

 private:
  class Writing;  // One transaction with its drafts.

  // What was held when an order to a destination was taken up (MissingRequest.mark).
  struct Mark {
    std::uint64_t number = 0;
    HaveSet have;
  };

  RecordStore(Options options, std::unique_ptr<Database> database)
      : options_(std::move(options)),
        rules_{options_.self, options_.policies, options_.custom_types, options_.for_ground},
        database_(std::move(database)),
        history_(options_.self, options_.history),
        authority_(AuthorityOptions(options_)),
        random_(options_.seed) {}
  static PeerAuthority::Options AuthorityOptions(const Options& options);
  Result<void> Load();
  Result<void> Repair();  // What a read through of all rows finds wrong.
  Result<void> Claim();   // For this agent; trouble of the disk is only noted where it is its file already.
  Result<proto::PruneReply> PruneHistory(const proto::PruneRequest& request, std::int64_t utc_now_ns);
  Result<void> WriteNextRowId(std::uint64_t row_id);
  Result<std::uint64_t> UsedByRecords();  // Bytes of pages.
  // Bytes that the file may have, by Options::bytes_max and its disk; none while it has less than one agent's part.
  Result<std::optional<std::uint64_t>> RoomToShare();
  Result<void> CheckRoomForMaps(const proto::InsertRequest& request);
  Result<void> CheckOwnRecord(const proto::Record& record) const;
  // Own epochs that others know. Restates what that endangers, also what could not be restated before.
  Result<void> LearnOwnEpochs(const std::set<std::uint64_t>& epochs);
  // What a peer says of them; what it is not believed, or cannot be, is passed over. `is_all`: the peer has no others
  // of this agent's own records.
  Result<void> LearnOwnEpochs(AgentId peer, const proto::HaveSet& claimed, bool is_all);
  std::set<std::uint64_t> BelievedEpochs(AgentId peer, const std::set<std::uint64_t>& claimed);
  Result<void> Reissue();
  Result<std::vector<RecordKey>> FindEndangered();
  Result<void> ReissueOne(const RecordKey& old_key, Writing& writing);
  bool IsPossible(const StreamKey& stream) const;  // Not of an own epoch that cannot be.

  Result<void> InsertAll(const proto::InsertRequest& request, const std::vector<std::string>& contents,
                         Inserted& result);
  Result<void> CheckInsert(const proto::InsertRequest& request) const;
  // Signs it where anybody may bring such records.
  Result<void> InsertSigned(const RecordKey& key, const proto::Record& record, const std::string& content,
                            Writing& writing);
  Result<void> InsertOne(const proto::Record& record, const std::string& content, bool is_local, Writing& writing,
                         proto::RecordKey& key);
  // kInvalid for odometry between two nodes of this agent between which another node of it is stored.
  Result<void> CheckConsecutive(const proto::PoseGraphEdge& edge, const Writing& writing);

  struct Opened {
    RecordKey key;
    proto::Record record;
    const proto::StoredRecord* stored;
  };
  std::vector<Opened> OpenBrought(const proto::StoreRequest& request, Stored& result);
  // Null where the request has no mark. Sets it where the number is new.
  const HaveSet* MarkedBy(const proto::MissingRequest& request);
  // As HaveRequest.is_for_peer has it.
  StreamHave ForPeer(DataType type, const StreamHave& have) const;
  Result<void> StoreAll(AgentId sender, const std::vector<Opened>& opened, const HaveSet& dropped, Stored& result);
  Result<void> StoreOne(AgentId sender, const Opened& opened, std::optional<std::uint64_t> room_bytes, Writing& writing,
                        Stored& result);
  Result<void> ApplyDropped(const StreamKey& stream, const IntervalSet& dropped, Writing& writing);
  Result<void> CheckDropped(AgentId sender, const proto::StreamHave& dropped, HaveSet& accepted);
  void NoteAssignmentsIn(const proto::StoreRequest& request);
  Result<void> CheckBrought(AgentId sender, const RecordKey& key, const proto::Record& record);
  void Reject(Error error, Stored& result);
  // True where `failure` is a full file or disk, and history made room: the transaction may be tried once more.
  bool MakesRoom(const Error& failure, std::uint64_t content_bytes);

  static Result<std::unique_ptr<RecordStore>> OpenFile(const Options& options);
  static Result<std::unique_ptr<RecordStore>> OpenFile(const Options& options, Database::Access access);
  Result<void> WriteDown(proto::EventKind kind, const std::string& text, std::int64_t utc_now_ns);

  const Options options_;
  const SharingRules rules_;
  std::unique_ptr<Database> database_;
  HaveLedger ledger_;
  std::map<std::pair<AgentId, proto::SharingKind>, Mark> marks_;  // By destination and kind.
  History history_;
  PeerLog peer_log_;
  PeerAuthority authority_;
  WriteCount write_count_;
  std::mt19937_64 random_;
  std::uint64_t epoch_ = 0;  // 0: the next shared insert begins one.
  OwnEpochs own_epochs_;
  bool is_reissue_due_ = false;  // Since an epoch was learnt that may endanger states.
  proto::RecordsStored reissued_;
  std::uint64_t next_row_id_ = 1;
  std::uint64_t rejected_count_ = 0;
  std::uint64_t pruned_count_ = 0;
  std::uint64_t map_bytes_ = 0;  // Of the contents of maps.
  // Contents of all rows but history, with kRowBytes for each row; none: not counted yet.
  std::optional<std::map<AgentId, std::uint64_t>> used_bytes_;
  std::optional<std::set<std::uint64_t>> own_nodes_;  // Indices of this agent's nodes; none: not read yet.
  std::string set_aside_;
  std::optional<Error> start_trouble_;
  std::vector<std::string> damage_;
};

}  // namespace moondb
