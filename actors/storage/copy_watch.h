// CopyWatch counts the records that exist on this agent's disk alone, as far as this agent knows, and dates the oldest.
//
// Another agent has a copy of a record if it acknowledged the record (PeerLog). This agent knows less of other agents'
// records: the agent that sent one had it. Therefore only the leader counts them, as long as neither the designated
// survivor nor the base station acknowledged them, and their origin counts as a holder. Superseded and pruned records
// need no copy. If the team file limits what agents keep, only the leader, the designated survivor and the base station
// hold copies, because any other agent may have removed a record.
//
// For one thread at a time.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <set>
#include <utility>

#include "actors/storage/peer_log.h"
#include "model/error.h"
#include "model/have_set.h"
#include "proto/storage.pb.h"
#include "proto/team.pb.h"

namespace moondb::proto {
class StorageStatus;
}  // namespace moondb::proto

namespace moondb {

class RecordStore;

class CopyWatch {
 public:
  using Time = std::chrono::time_point<std::chrono::steady_clock, std::chrono::nanoseconds>;

  // Requires: `team` is complete and validated.
  CopyWatch(AgentId self, const proto::TeamConfig& team);

  // Call when this agent acts on other roles.
  void ObserveRoles(const proto::RoleAssignment& roles);
  // Call now and then with the row id that the next record will get. The ages depend on these calls: a record counts as
  // stored at the last call before it. Calls that lie far back are thinned out, so an age is up to 1/32 too large.
  void ObserveTime(Time now, std::uint64_t next_row_id);

  // Fills in one_copy and backlogs. Errors are those of Database.
  Result<void> Describe(RecordStore& store, Time now, proto::StorageStatus& status) const;

 private:
  // Returns the records of `have` of which no other agent is known to have a copy.
  HaveSet FindOneCopy(const HaveSet& have, const PeerLog& log) const;
  bool HoldsForOthers(AgentId peer) const;
  // Returns whether records of the origin can have one copy, this agent's.
  bool IsCounted(AgentId origin) const;

  const AgentId self_;
  std::set<AgentId> peers_;
  std::set<AgentId> base_stations_;
  bool is_limited_ = false;  // True if the team file limits what agents keep.
  AgentId leader_ = 0;
  AgentId survivor_ = 0;
  // Times of ObserveTime with the row id at each, ascending. Their distance grows with their age, so there are few.
  std::deque<std::pair<Time, std::uint64_t>> times_;
};

}  // namespace moondb
