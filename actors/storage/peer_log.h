// PeerLog: what peers are known to have, and what the open sessions handed to them, for the view replication_log.
//
// It shows, and decides a guess (OwnEpochs::Danger): lost at a power cut, it comes back with the next session. A
// session notes all that its peer has once, then differences, which are numbered (proto::PeerHave). One that does not
// follow the note before changes nothing of what the peer is known to have: its sender is asked for all again.
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
  // Forgets what was handed over by an earlier process.
  Result<void> Load(Database& database);

  // False: it is a difference that does not follow the last note taken, so that only what it says of the session was.
  // kInvalid where it is malformed; else fails as Database does, and then nothing changed. The next difference does not
  // follow either.
  Result<bool> Note(Database& database, const proto::PeerHave& note);

  // Whether any peer is known to have it, or what replaced it.
  bool IsCoveredByAny(const RecordKey& key) const;

 private:
  using Covered = std::map<StreamKey, IntervalSet>;

  Result<bool> ReadAll(Database& database);
  const Covered& KnownOf(AgentId peer) const;
  bool Follows(const proto::PeerHave& note) const;
  // The streams in which `note` changes what its peer is known to have, whole; empty: it has nothing of it any more.
  Covered ChangedBy(const proto::PeerHave& note, const HaveSet& acknowledged) const;
  void Apply(AgentId peer, Covered changed);

  std::map<AgentId, Covered> covered_;  // As in the table peer_have.
  // The number of the last note that was taken, by peer and kind of session; none: all has to be noted first.
  std::map<std::pair<AgentId, proto::SharingKind>, std::uint64_t> numbers_;
};

}  // namespace moondb
