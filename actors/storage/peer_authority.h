// PeerAuthority: decides which peers may supply which records.
//
// Records of an agent are accepted from that agent itself and from the base station. They are also accepted from an
// agent that is or was leader or survivor by a valid assignment held here (model/role_chain.h). Other peers may not
// supply records of a third agent, or report them as dropped; such messages are refused, and counted for the sender. A
// dishonest member can thus lie only about itself. Exceptions: any agent may supply role assignments and map
// quarantines, because they are signed. In a team without signing keys all peers are trusted. Claims about this agent's
// own epochs are accepted from peers that may supply records of other agents.
//
// Streams: a have-set has at most kHaveStreamsMax streams. Half of the streams are divided equally among the agents of
// the team. An agent that needs more streams takes them from the other half until that half is used up. Further streams
// are refused.
//
// Disk space: the same rule limits the bytes of other agents' records, but not those of this agent's own records.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "actors/storage/have_ledger.h"
#include "actors/storage/sqlite_database.h"
#include "model/error.h"
#include "model/have_set.h"
#include "model/record_key.h"
#include "model/role_chain.h"
#include "proto/record.pb.h"
#include "proto/storage.pb.h"
#include "proto/term.pb.h"
#include "proto/types.pb.h"

namespace moondb::proto {
class AgentStatus;
class Record;
}  // namespace moondb::proto

namespace moondb {

class PeerAuthority {
 public:
  // Returns whether records of the type are signed. Any agent may supply signed records.
  static bool IsSignedType(DataType type) { return type == proto::ROLE_ASSIGNMENT || type == proto::MAP_QUARANTINE; }

  static constexpr std::size_t kOwnBeyondMax = 64;  // Maximum number of keys per peer (ObserveOwnBeyond).

  struct Options {
    AgentId self = 0;
    AgentId base = 0;  // The base station; 0 if the team has none.
    std::set<AgentId> team;
    RoleChain::Options roles = RoleChain::WithoutKeys();
    // Used only in a team with signing keys. `is_signed` checks an assignment's signature with its issuer's key.
    // `is_record_signed` checks the signature of a record that any agent may supply, with its origin's key.
    std::function<bool(const proto::RoleAssignment&)> is_signed;
    std::function<bool(const RecordKey&, const proto::Record&)> is_record_signed;
  };
  enum class Cause { kOrigin, kStreams, kStatement, kDiskRoom };

  explicit PeerAuthority(Options options);

  // Loads the role assignments in the store: the assignments that this agent acted on, and the assignments stored as
  // records.
  Result<void> Load(Database& database);
  // Call after an assignment is committed. `is_record` is true if the assignment was stored as a record.
  void ObserveAssignment(const proto::RoleAssignment& roles, bool is_record);
  void ObserveIfSigned(const proto::RoleAssignment& roles);
  // Returns `roles` and its predecessors of the same era (RoleChain), newest first. If one of these assignments is held
  // as a record, the list ends before that assignment.
  std::vector<proto::RoleAssignment> NotHeldAsRecords(const proto::RoleAssignment& roles) const;

  // Returns whether records of other agents are accepted from `sender`. `sender` 0 means this agent.
  bool IsBelieved(AgentId sender) const;
  // Fails with kRefused, and counts the refusal, if the sender may not supply the record.
  Result<void> CheckRecord(AgentId sender, const RecordKey& key, const proto::Record& record);
  // Fails with kRefused, and counts the refusal, if the sender may not report drops of this stream.
  Result<void> CheckOrigin(AgentId sender, const StreamKey& stream);
  // Fails with kRefused, and counts the refusal, if `ledger` does not contain the stream yet and has no room for
  // another stream of the stream's origin.
  Result<void> CheckRoom(AgentId sender, const StreamKey& stream, const HaveLedger& ledger);
  // Fails with kRefused, and counts the refusal for `origin`, if the records of `origin` have used up their part of
  // `room_bytes`. `room_bytes` is the disk space for the records of all agents. `used_bytes` is the space used now, by
  // origin.
  Result<void> CheckDiskRoom(AgentId origin, const std::map<AgentId, std::uint64_t>& used_bytes,
                             std::uint64_t room_bytes);
  // Fails with kRefused, and counts the refusal, if the assignment is not signed by its issuer.
  Result<void> CheckAssignment(AgentId sender, const proto::RoleAssignment& roles);
  // Checks a quarantine that this agent wants to store. Fails with kRefused if it concerns another agent's maps or
  // lifts another agent's quarantine, unless this agent is the leader or is listed in command_from of the team file.
  Result<void> CheckOwnQuarantine(const proto::Record& record) const;
  // Checks a prior that this agent wants to store. Fails with kRefused if it concerns another agent's node, unless this
  // agent is listed in command_from of the team file.
  Result<void> CheckOwnPrior(const proto::Record& record) const;
  // Returns whether the newest valid assignment names the agent leader or survivor.
  bool HasRole(AgentId agent) const { return chain_.newest().leader() == agent || chain_.newest().survivor() == agent; }
  // Returns the newest known valid term.
  const proto::Term& newest_term() const { return chain_.newest().term(); }
  // Counts a refused record that its origin may not write in any role (CheckSpeaker).
  void CountStatement(AgentId origin) { CountRefused(origin, Cause::kStatement, 0); }
  // Remembers the report of a reader (an actor): how many stored records of each origin the reader ignores because of
  // the origin's role. Replaces the reader's last report.
  void AddExcluded(const std::string& reader, const proto::LeftOutReport& report);

  // Remembers own records of this agent that `peer` reported although this disk never held them. Each key is the last
  // such record of a stream; type and seq are 0 if only the epoch is known. If `is_all`, `beyond` replaces earlier
  // reports of the peer. At most kOwnBeyondMax keys are remembered per peer.
  void ObserveOwnBeyond(AgentId peer, const std::vector<RecordKey>& beyond, bool is_all);

  // Fills in the counts of refused records by sender, and the own records that peers reported and `have` does not
  // cover.
  void Describe(const HaveSet& have, proto::AgentStatus& status) const;

 private:
  void CountRefused(AgentId sender, Cause cause, AgentId origin);

  const Options options_;
  RoleChain chain_;
  std::set<std::string> held_as_records_;  // Signatures of the assignments held as records.
  std::map<std::tuple<AgentId, Cause, AgentId>, std::uint64_t> refused_;  // Counts by sender, cause and origin.
  // By peer and stream: the last seq that ObserveOwnBeyond received; 0 if only the epoch is known.
  std::map<AgentId, std::map<StreamKey, std::uint64_t>> own_beyond_;
  // The last LeftOutReport of each actor that reads records, by the actor's name.
  std::map<std::string, proto::LeftOutReport> left_out_;
};

}  // namespace moondb
