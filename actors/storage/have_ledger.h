// HaveLedger: this agent's have-set, in memory and in the table have_interval, never one without the other.
//
// Edits go to a draft. Write puts the draft into the database inside the caller's transaction, and only after that
// transaction's commit does Keep make it the have-set; after a failure Forget leaves all as it was.
#pragma once

#include <map>

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"

namespace moondb {

class HaveLedger {
 public:
  // Rows that are damaged are left out.
  Result<void> Load(Database& database);
  // No row was damaged.
  bool is_sound() const { return is_sound_; }
  // Instead of all that the table holds, inside the caller's transaction; then Keep.
  Result<void> Replace(Database& database, const HaveSet& have);

  const HaveSet& have() const { return have_; }

  // The draft's state of a stream, else the have-set's.
  const StreamHave& Get(const StreamKey& stream) const;
  // How many of an origin's anything was had of, with the draft's.
  std::size_t StreamsOf(AgentId origin) const;
  void AddHeld(const StreamKey& stream, std::uint64_t seq);
  // The last, in its origin's order, of an origin's records of a type that is held; seq 0: none is.
  RecordKey NewestHeld(AgentId origin, DataType type) const;
  // Had, but not held any more, or never.
  void AddDropped(const StreamKey& stream, IntervalSet::Interval interval);

  Result<void> Write(Database& database) const;
  void Keep();
  void Forget();

 private:
  StreamHave& Edit(const StreamKey& stream);
  void CountStreams();

  HaveSet have_;
  bool is_sound_ = true;
  std::map<StreamKey, StreamHave> draft_;
  std::map<AgentId, std::size_t> stream_counts_;  // Of have_.
  std::map<AgentId, std::size_t> new_in_draft_;
};

}  // namespace moondb
