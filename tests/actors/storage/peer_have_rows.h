// Reads from table peer_have which records a peer covers, for comparison with a have-set.
#pragma once

#include <map>

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"
#include "model/ids.h"

namespace moondb {

using Covered = std::map<StreamKey, IntervalSet>;

inline Covered ShownIn(Database& database, AgentId peer) {
  Query query = database.Prepare("SELECT origin, epoch, data_type, first, last FROM peer_have WHERE peer = ?");
  query << peer;
  Covered shown;
  while (*query.Step()) {
    const StreamKey stream{static_cast<AgentId>(query.Integer(0)), query.Unsigned(1),
                           static_cast<DataType>(query.Integer(2))};
    shown[stream].Add({query.Unsigned(3), query.Unsigned(4)});
  }
  return shown;
}

// Returns the records that `have` covers, by stream. Leaves out streams without covered records.
inline Covered HadOf(const HaveSet& have) {
  Covered covered;
  for (const auto& [stream, of_stream] : have.streams()) {
    if (!of_stream.Covered().is_empty()) covered[stream] = of_stream.Covered();
  }
  return covered;
}

}  // namespace moondb
