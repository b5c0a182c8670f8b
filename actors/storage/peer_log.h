// PeerLog: what peers are known to have, and what the open sessions have handed to them. Shown by the view
// replication_log.
//
// The log is for display, and for cases that OwnEpochs::Danger cannot decide. It may lose entries at a power cut; the
// next session restores them. A session first reports everything that its peer has, then numbered differences
// (proto::PeerHave). A difference that does not follow the last report is not applied, and its sender is asked for a
// full report.
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
  // Loads the table, and deletes what an earlier process noted as handed over.
  Result<void> Load(Database& database);

  // Applies a report. Returns false if it is a difference that does not follow the last applied report; then only the
  // part about the session is applied. kInvalid if the report is malformed. Other errors are as for Database. After an
  // error nothing has changed, and the next difference does not follow either.
  Result<bool> Note(Database& database, const proto::PeerHave& note);

  // Returns whether any peer is known to cover the record (to hold or have dropped it).
  bool IsCoveredByAny(const RecordKey& key) const;

 private:
  using Covered = std::map<StreamKey, IntervalSet>;

  Result<bool> ReadAll(Database& database);
  const Covered& KnownOf(AgentId peer) const;
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
