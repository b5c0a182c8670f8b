// RecordStore: everything that an agent stores, in one SQLite file: records, the have-set, roles, and what peers have
// (paper, Sections 3 and 4).
//
// Records are immutable and named by (origin, epoch, data type, seq). Each call that writes is one transaction. If the
// transaction fails, file and memory are as before, and the store remains usable.
//   - Epochs: the first shared insert of a process begins an epoch above every own epoch known here (own_epochs.h). If
//     a peer knows a later own epoch, the disk was lost or restored, and the next insert begins an epoch above that
//     epoch.
//   - Reissuing: if a later epoch of this agent cannot have known the newest states of an earlier epoch, these states
//     are stored again under a new epoch. An older state that a peer returns thus never replaces a newer state. If
//     reissuing fails, the call stores nothing, and later calls retry.
//   - seqs have no gaps within (epoch, type), because they are allocated in the transaction that stores their rows.
//   - Superseding: under the policy `latest`, a state (Record.is_state) supersedes the older states of its (origin,
//     type, latest key), in RecordOrder. One transaction stores the newer state, deletes the older rows or moves them
//     to the history (history.h), and marks their seqs as dropped. A record stored under `all` supersedes nothing and
//     is never superseded.
//   - Custom types: an own record can be inserted only if the team file declares its type. Peers' records of undeclared
//     types are carried (sharing_rules.h).
//   - Drops: a peer's drops are accepted only for `latest` and carried types, and only if a newer record of that origin
//     and type is held here (for poses and edge verdicts: any record). The newest row of a key stays until its
//     successor arrives, because the successor may be lost.
//   - Pruned records (prune.h) are dropped in the have-set, so they are never fetched again. Peers do not learn of
//     these drops. If this disk is lost, peers return the records that they still hold.
//
// For one thread at a time. Cannot be moved or copied; Open returns a pointer.
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
    std::string path;  // The file. Its folder must exist. ":memory:" for tests.
    std::string vfs;   // VFS name, as for Database::Open.
    AgentId self = 0;  // This agent. The file stores it as its owner.
    // All agents of the team, this one included. Records from or about any other agent are refused.
    std::set<AgentId> team;
    // Sharing policies of the built-in types. Types without a policy are not shared.
    SharingRules::Policies policies;
    CustomTypes custom_types;       // The custom types of the team file.
    std::set<DataType> for_ground;  // Types of which a ground station wants all records.
    std::uint64_t seed = 0;         // Seed of the random bits of epochs.
    std::uint64_t bytes_max = 0;    // Size limit of the file; 0: limited by the disk only.
    // If the tables use at least this many bytes, own maps are refused (kFull) to leave room for states; 0: no limit.
    // See map_budget.h.
    std::uint64_t map_store_bytes_max = 0;
    // True if this process opened the file before. The file is then not checked again (1 ms per MB).
    bool is_checked = false;
    History::Rules history;  // Which own superseded records are kept; none by default.
    // Which peers may supply which records; by default all peers may. Open fills in `self` and `team`.
    PeerAuthority::Options authority;
    // Signs this agent's own map quarantines, so that any peer may supply them. Empty in a team without signing keys.
    std::function<std::string(const RecordKey&, const proto::Record&)> sign;
  };

  // Opens the file, creates it if needed, and checks all of it. A damaged file is renamed and replaced by an empty file
  // with a new epoch. If the row of a shared record is missing or does not match its hash, the record is no longer
  // held. In both cases peers send the lost records again if they hold them.
  //
  // An existing store also opens on a disk that is full, failing or read-only, unless the store has to be repaired. On
  // a full disk Open gives up the reserve, and a later start logs the events that this start could not log.
  //
  // Fails with kRefused, without a change to the file, if the file belongs to another store version, program or agent
  // (schema.h). Fails with kUnavailable if another process uses the file. kFull, kInternal and kCorrupt are as for
  // Database.
  static Result<std::unique_ptr<RecordStore>> Open(Options options);
  // The error that kept Open from writing to the file; null if all writes succeeded or none were needed.
  const std::optional<Error>& start_trouble() const { return start_trouble_; }
  // Path of the damaged file that Open set aside; empty if there was none.
  const std::string& set_aside() const { return set_aside_; }
  // One sentence for each damage that Open found.
  const std::vector<std::string>& damage() const { return damage_; }

  // Call once at the start of a process, before its actors run. Logs the damage that Open found, and whether the
  // previous process ended without stopping. If the store has no events yet, also logs a damaged file that an earlier,
  // failed start set aside.
  Result<void> LogLastRun(std::int64_t utc_now_ns);
  // Call last when the process stops in an orderly way. The next process then logs no abnormal end.
  Result<void> WriteDownStop(std::int64_t utc_now_ns);
  // Returns the open findings of this agent (actors/storage/findings.h).
  Result<std::vector<proto::HealthFinding>> Findings();

  // Inserts all own records, or inserts none and returns an error. If a record with the same natural key (node, edge)
  // and the same content exists, the reply contains the existing record's key. If the existing record has other
  // content, the error is kInvalid.
  struct Inserted {
    proto::InsertReply reply;
    proto::RecordsStored stored;  // last_row_id is 0 if there are no new rows.
  };
  Inserted Insert(const proto::InsertRequest& request);
  // Fails with kFull if other agents' maps are refused to leave room for own ones (map_budget.h). The leader and the
  // survivor accept them, because theirs are the team's safe copies.
  Result<void> CheckRoomForOthersMaps();

  // Stores records of any origin from a peer. Each record is validated, and stored or rejected, separately. If the
  // transaction fails, no record is stored. After a success, all records that `reply.covered` covers survive a power
  // cut. `reply.covered` exceeds the size of a have-set page only if the request's records lie in very many separate
  // intervals.
  struct Stored {
    proto::StoreReply reply;
    proto::RecordsStored stored;
    std::vector<Error> rejections;  // The first few rejections, for the log file.
    // Records that their origin may not write in any role (CheckSpeaker). `reply.covered` includes these records, so
    // the session does not send them again. The store's own have-set does not include them.
    std::vector<RecordKey> never_valid;
  };
  Stored Store(const proto::StoreRequest& request);

  proto::HaveReply GetHave(const proto::HaveRequest& request = {}) const;

  // Accepts a peer's report about this agent's own epochs. Fails with kInvalid, and accepts nothing, if the report has
  // more than kEpochReportMax epochs, contains epoch 0, or does not list the epochs in strictly rising order.
  // Impossible epochs are skipped and counted as rejected.
  Result<void> ObserveEpochReport(AgentId peer, const proto::EpochReport& report);
  // Returns the highest epochs of `origin` in this store's have-set, at most kEpochReportMax, to be sent to `origin`.
  proto::EpochReport ReportEpochs(AgentId origin) const;
  static constexpr int kEpochReportMax = 64;
  // Returns the records reissued since the last call of this function.
  proto::RecordsStored TakeReissued();
  // Returns true once, after a peer reported own epochs that this disk does not have.
  bool TakeLearnedEpochs() { return own_epochs_.TakeLearned(); }

  // Returns the records that a destination lacks; see FindMissing. Fails with kInvalid if the destination's have-set is
  // malformed. Other errors are as for Database.
  Result<proto::MissingReply> GetMissing(const proto::MissingRequest& request);
  // Reads a page of the held records. If the request has is_history, reads a page of this agent's own history instead.
  Result<proto::ReadReply> Read(const proto::ReadRequest& request);
  // Stores the role assignment to act on, with its missing predecessors, in one transaction. If the assignment makes
  // this agent leader or survivor, it is also stored as a record, with its predecessors that are not yet records. Peers
  // need these records to check that this agent may supply other agents' records.
  Result<proto::RecordsStored> SaveRoles(const proto::SaveRolesRequest& request);
  // Remembers the number of records that a reader ignores; see PeerAuthority::AddExcluded.
  void AddExcluded(const std::string& reader, const proto::LeftOutReport& report) {
    authority_.AddExcluded(reader, report);
  }
  // Fills in the number of refused records per peer; see PeerAuthority::Describe.
  void DescribeRefused(proto::AgentStatus& status) const { authority_.Describe(ledger_.have(), status); }
  Result<proto::LoadRolesReply> LoadRoles();
  // Applies a session's report of the records that a peer has; see PeerLog::Store.
  Result<bool> ObservePeerHave(const proto::PeerHave& note);
  // `day` is today, in days since 1970. StorageStatus shows the bytes written per day.
  Result<proto::StorageStatus> GetStatus(std::uint32_t day = 0);
  // Call once a minute. Saves the count of bytes written, if it changed.
  Result<void> SaveWritten(std::uint32_t day) { return write_count_.Save(*database_, day); }

  // Removes the rows that the request selects, but at most `rows_max` of them. A dry run only counts the rows. Durable
  // on return. On a full disk, pass a small `rows_max`, since the removal of few rows needs little space. Fails as
  // ChooseToPrune does.
  Result<proto::PruneReply> Prune(const proto::PruneRequest& request, std::int64_t utc_now_ns,
                                  std::size_t rows_max = SIZE_MAX);
  // Rewrites an existing value, to test whether the disk accepts writes.
  Result<void> TryToWrite();
  // Call periodically. Removes some rows that the history's rules no longer keep. Returns true if there may be more
  // such rows. `utc_now_ns` is null if this agent does not know the time.
  Result<bool> TrimHistory(std::optional<std::int64_t> utc_now_ns);
  // Call if space is short. Removes the oldest rows of history until `bytes` bytes are freed or history is empty.
  // Returns the bytes freed. Durable on return.
  Result<std::uint64_t> DropHistory(std::uint64_t bytes);
  // Check the store for an operator; see actors/storage/verify.h.
  Result<proto::VerifyReply> Verify(const proto::VerifyRequest& request);
  Result<proto::FingerprintReply> TakeFingerprint(const proto::FingerprintRequest& request);

  // Store, read and acknowledge bundles for a ground station; see actors/storage/bundle_shelf.h.
  Result<void> SaveBundle(const proto::SaveBundleRequest& request);
  Result<proto::LoadBundlesReply> LoadBundles();
  Result<proto::ReadBundleReply> ReadBundle(const proto::ReadBundleRequest& request);
  Result<void> AcknowledgeBundle(std::uint32_t number);

  // This agent's have-set, what peers are known to have, and the row id of the next record.
  const HaveSet& have() const { return ledger_.have(); }
  const PeerLog& peer_log() const { return peer_log_; }
  std::uint64_t next_row_id() const { return next_row_id_; }
  // For tests and tools that inspect the tables.
  Database& database() { return *database_; }

 private:
  class Writing;  // A transaction, with the changes to the in-memory state that take effect when it commits.

  // A MissingRequest.mark, and the have-set at the time of the first request with this mark.
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
  Result<void> Repair();  // Repairs the damage that a check of all rows found (RowAudit).
  // Makes this agent the owner of the file. If this agent already is the owner, a disk error is stored in
  // start_trouble_ and not returned.
  Result<void> Claim();
  Result<proto::PruneReply> PruneHistory(const proto::PruneRequest& request, std::int64_t utc_now_ns);
  Result<void> WriteNextRowId(std::uint64_t row_id);
  // Returns the maximum size of the file: Options::bytes_max, or less if the disk has less space. Returns null while
  // the file's used pages take less than one agent's guaranteed part of this size (PeerAuthority), because no agent can
  // then exceed its part.
  Result<std::optional<std::uint64_t>> RoomToShare();
  Result<void> CheckRoomForMaps(const proto::InsertRequest& request);
  Result<void> CheckOwnRecord(const proto::Record& record) const;
  // Adds own epochs that other agents know. Reissues the states that these epochs endanger, and states whose earlier
  // reissue failed.
  Result<void> LearnOwnEpochs(const std::set<std::uint64_t>& epochs);
  // Adds own epochs that occur in a peer's have-set. Skips impossible epochs, and epochs for which the peer is not
  // trusted. If `is_all`, `claimed` contains all records of this agent that the peer has.
  Result<void> LearnOwnEpochs(AgentId peer, const proto::HaveSet& claimed, bool is_all);
  std::set<std::uint64_t> BelievedEpochs(AgentId peer, const std::set<std::uint64_t>& claimed);
  Result<void> Reissue();
  Result<std::vector<RecordKey>> FindEndangered();
  Result<void> ReissueOne(const RecordKey& old_key, Writing& writing);
  bool IsPossible(const StreamKey& stream) const;  // False for an own epoch that is 0 or too high (kOwnEpochJumpMax).

  Result<void> InsertAll(const proto::InsertRequest& request, const std::vector<std::string>& contents,
                         Inserted& result);
  Result<void> CheckInsert(const proto::InsertRequest& request) const;
  // Inserts a row. Signs the record if it is a map quarantine and the team has signing keys.
  Result<void> InsertSigned(const RecordKey& key, const proto::Record& record, const std::string& content,
                            Writing& writing);
  Result<void> InsertOne(const proto::Record& record, const std::string& content, bool is_local, Writing& writing,
                         proto::RecordKey& key);
  // Fails with kInvalid if the edge is odometry between two nodes of this agent, and the index of another stored node
  // lies between the indices of the two nodes.
  Result<void> CheckConsecutive(const proto::PoseGraphEdge& edge, const Writing& writing);

  struct Opened {
    RecordKey key;
    proto::Record record;
    const proto::StoredRecord* stored;
  };
  std::vector<Opened> OpenBrought(const proto::StoreRequest& request, Stored& result);
  // Returns the have-set at the time of the first request with the same mark; null if the request has no mark. If the
  // mark is new, saves the current have-set for it.
  const HaveSet* MarkedBy(const proto::MissingRequest& request);
  // Returns the state of a stream to report to peers (HaveRequest.is_for_peer).
  StreamHave ForPeer(DataType type, const StreamHave& have) const;
  Result<void> StoreAll(AgentId sender, const std::vector<Opened>& opened, const HaveSet& dropped, Stored& result);
  Result<void> StoreOne(AgentId sender, const Opened& opened, std::optional<std::uint64_t> room_bytes, Writing& writing,
                        Stored& result);
  Result<void> ApplyDropped(const StreamKey& stream, const IntervalSet& dropped, Writing& writing);
  Result<void> CheckDropped(AgentId sender, const proto::StreamHave& dropped, HaveSet& accepted);
  void ObserveAssignmentsIn(const proto::StoreRequest& request);
  Result<void> CheckBrought(AgentId sender, const RecordKey& key, const proto::Record& record);
  void Reject(Error error, Stored& result);
  // If `failure` is kFull, removes history. Returns true if rows were removed; the caller should then retry.
  bool MakesRoom(const Error& failure, std::uint64_t content_bytes);

  static Result<std::unique_ptr<RecordStore>> OpenFile(const Options& options);
  static Result<std::unique_ptr<RecordStore>> OpenFile(const Options& options, Database::Access access);
  Result<void> WriteDown(proto::EventKind kind, const std::string& text, std::int64_t utc_now_ns);

  const Options options_;
  const SharingRules rules_;
  std::unique_ptr<Database> database_;
  HaveLedger ledger_;
  std::map<std::pair<AgentId, proto::SharingKind>, Mark> marks_;  // Marks by destination and kind of session.
  History history_;
  PeerLog peer_log_;
  PeerAuthority authority_;
  WriteCount write_count_;
  std::mt19937_64 random_;
  std::uint64_t epoch_ = 0;  // Current epoch of own records; 0 until a shared insert begins it.
  OwnEpochs own_epochs_;
  bool is_reissue_due_ = false;  // True after a foreign epoch became known, until Reissue has succeeded.
  proto::RecordsStored reissued_;
  std::uint64_t next_row_id_ = 1;
  std::uint64_t rejected_count_ = 0;
  std::uint64_t pruned_count_ = 0;
  std::uint64_t map_bytes_ = 0;  // Bytes of the contents of all map rows.
  // Bytes of the contents of all rows except history, plus kRowBytes per row, by origin. Null until they are counted.
  std::optional<std::map<AgentId, std::uint64_t>> used_bytes_;
  // Indices of this agent's nodes; null until they are read.
  std::optional<std::set<std::uint64_t>> own_nodes_;
  std::string set_aside_;
  std::optional<Error> start_trouble_;
  std::vector<std::string> damage_;
};

}  // namespace moondb
