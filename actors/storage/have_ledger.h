// HaveLedger: this agent's have-set, a version vector whose entries are interval sets. It is kept both in memory and in
// the table have_interval, with the same content.
//
// Edits change a draft. Write puts the draft into the database, inside the caller's transaction. After the commit, Keep
// makes the draft the have-set. After a failure, Forget discards the draft.
#pragma once

#include <map>

#include "actors/storage/sqlite_database.h"
#include "model/have_set.h"

namespace moondb {

class HaveLedger {
 public:
  // Loads the have-set from the table. Skips damaged rows.
  Result<void> Load(Database& database);
  // Returns true if Load found no damaged row.
  bool is_sound() const { return is_sound_; }
  // Inside the caller's transaction: replaces the have-set by `have`. Call Keep after the commit; until then have() is
  // empty.
  Result<void> Replace(Database& database, const HaveSet& have);

  const HaveSet& have() const { return have_; }

  // Returns the state of a stream, including changes that Keep has not applied yet.
  const StreamHave& Get(const StreamKey& stream) const;
  // Returns the number of streams of an origin, including new streams that Keep has not added yet.
  std::size_t StreamsOf(AgentId origin) const;
  void AddHeld(const StreamKey& stream, std::uint64_t seq);
  // Returns the held record of an origin and type with the greatest epoch and seq. Returns seq 0 if no record is held.
  RecordKey NewestHeld(AgentId origin, DataType type) const;
  // Marks seqs as dropped: covered by the have-set, but not held.
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
  std::map<AgentId, std::size_t> stream_counts_;  // Streams of `have_` per origin.
  std::map<AgentId, std::size_t> new_in_draft_;
};

}  // namespace moondb
