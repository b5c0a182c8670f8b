// PeerLog: the log of which records each peer is known to have, and which records open sessions have sent to the peer.
// The view replication_log shows the log.
//
// The log is used for display (also of records with one copy, copy_watch.h), and for the uncertain cases of
// OwnEpochs::Danger. A power cut may remove entries; the next session restores them. A session first reports all
// records that its peer has (a full report), then numbered differences (proto::PeerHave). If a difference does not have
// the number after the last report's number, the difference is not applied, and the session must send a full report.
#pragma once

#include <cstdint>
#include <map>
#include <utility>

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/storage.pb.h"

namespace moondb {

class PeerLog {
 public:
  // Loads the table. Deletes the entries about records that sessions of an earlier process sent.
  Result<void> Load(Database& database);

  // Applies a report. Returns false if the report is a difference that does not follow the last applied report. In this
  // case only the report's part about the session is applied. Fails with kInvalid if the report is malformed. Other
  // errors are as for Database. After an error the log is unchanged, and Store returns false for the next difference.
  Result<bool> Store(Database& database, const proto::PeerHave& note);

  // Returns whether any peer is known to cover the record (to hold or have dropped it).
  bool IsCoveredByAny(const RecordKey& key) const;

  using Covered = std::map<StreamKey, IntervalSet>;
  // Returns the records that the peer is known to cover. Valid until the next call of Store or Load.
  const Covered& KnownOf(AgentId peer) const;

 private:
  Result<bool> ReadAll(Database& database);
  bool Follows(const proto::PeerHave& note) const;
  // Returns the new state of each stream that `note` changes for its peer. An empty set means that the peer no longer
  // covers any seq of the stream.
  Covered ChangedBy(const proto::PeerHave& note, const HaveSet& acknowledged) const;
  void Apply(AgentId peer, Covered changed);

  std::map<AgentId, Covered> covered_;  // Same content as the table peer_have.
  // Number of the last applied report, by peer and kind of session. If there is no entry, only a full report can be
  // applied.
  std::map<std::pair<AgentId, proto::SharingKind>, std::uint64_t> numbers_;
};

}  // namespace moondb
