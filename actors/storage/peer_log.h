// PeerLog: what peers are known to have, and what the open sessions handed to them, for the view replication_log.
//
// It shows, and decides a guess (OwnEpochs::Danger): lost at a power cut, it comes back with the next session.
#pragma once

#include <cstdint>
#include <map>

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "proto/storage.pb.h"

namespace moondb {

class PeerLog {
 public:
  // Forgets what was handed over by an earlier process.
  Result<void> Load(Database& database);

  // `note.acknowledged`, where it names any stream, is all that the peer has. kInvalid where it is malformed; else
  // fails as Database does, and then nothing changed.
  Result<void> Note(Database& database, const proto::PeerHave& note);

  // Whether any peer is known to have it, or what replaced it.
  bool IsHadByAny(const RecordKey& key) const;

 private:
  using Had = std::map<StreamKey, IntervalSet>;

  Result<bool> ReadAll(Database& database);

  std::map<AgentId, Had> had_;  // As in the table peer_have.
};

}  // namespace moondb
