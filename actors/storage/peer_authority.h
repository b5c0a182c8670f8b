// PeerAuthority: whose word this agent's store takes, and for what.
//
// Records of an agent are taken from that agent itself, from the base station, and from who leads or survives, or did,
// in an assignment that counts and is held here (model/role_chain.h); assignments and quarantines of maps, which are
// signed, from anybody. From others records of a third agent are refused, and the bringer is counted by name: a member
// that lies lies about itself alone. So are drops. What peers claim of this agent's own epochs is believed from the
// same ones. In a team without signing keys all are believed.
//
// Streams: a have-set has kHaveStreamsMax of them at most. Of half of these each agent of the team has an equal part;
// who needs more takes of the other half what nobody else has. What goes beyond is refused.
//
// Disk room: the same rule holds for the bytes of other agents' records. This agent's own records are not limited by
// it.
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
  // Whether records of the type are signed, so that any agent may bring them.
  static bool IsSignedType(DataType type) { return type == proto::ROLE_ASSIGNMENT || type == proto::MAP_QUARANTINE; }

  static constexpr std::size_t kOwnBeyondMax = 64;  // Of a peer's.

  struct Options {
    AgentId self = 0;
    AgentId base = 0;  // 0: the team has none.
    std::set<AgentId> team;
    RoleChain::Options roles = RoleChain::WithoutKeys();
    // In a team with keys alone: by the issuer's key, and by the origin's of a record that anybody may bring.
    std::function<bool(const proto::RoleAssignment&)> is_signed;
    std::function<bool(const RecordKey&, const proto::Record&)> is_record_signed;
  };
  enum class Cause { kOrigin, kStreams, kStatement, kDiskRoom };

  explicit PeerAuthority(Options options);

  // The assignments that the store holds: those that were acted on, and those that came as records.
  Result<void> Load(Database& database);
  // Of one that is committed; `is_record`: as a record.
  void NoteAssignment(const proto::RoleAssignment& roles, bool is_record);
  void NoteIfSigned(const proto::RoleAssignment& roles);
  // What ends with this one, newest first, and is not held as a record.
  std::vector<proto::RoleAssignment> NotHeldAsRecords(const proto::RoleAssignment& roles) const;

  // Whether the agent's word is taken for other agents' records; 0 is this agent's own.
  bool IsBelieved(AgentId sender) const;
  // kRefused, and counted: the sender may not bring it.
  Result<void> CheckRecord(AgentId sender, const RecordKey& key, const proto::Record& record);
  // kRefused, and counted: the sender may not say what was dropped of this stream.
  Result<void> CheckOrigin(AgentId sender, const StreamKey& stream);
  // kRefused, and counted: of its origin `ledger` has no room for this stream, which is new there.
  Result<void> CheckRoom(AgentId sender, const StreamKey& stream, const HaveLedger& ledger);
  // kRefused, and counted for `origin`: its records have used up their part of `room_bytes`, which is what the records
  // of all agents may take. `used_bytes`: what they take now, by origin.
  Result<void> CheckDiskRoom(AgentId origin, const std::map<AgentId, std::uint64_t>& used_bytes,
                             std::uint64_t room_bytes);
  // kRefused, and counted: not signed by its issuer.
  Result<void> CheckAssignment(AgentId sender, const proto::RoleAssignment& roles);
  // kRefused: a quarantine of another agent's maps, or one that lifts another agent's, would not count: this agent is
  // not in command_from of the team file and does not lead.
  Result<void> CheckOwnQuarantine(const proto::Record& record) const;
  // The newest term that is known and counts.
  const proto::Term& newest_term() const { return chain_.newest().term(); }
  // A record of this origin came that its origin may not state.
  void CountStatement(AgentId origin) { CountRefused(origin, Cause::kStatement, 0); }
  // How many held records a reader (an actor) leaves out by the origin's role, by origin. Replaces the reader's last
  // word.
  void NoteLeftOut(const std::string& reader, const proto::LeftOutReport& report);

  // Of this agent's own records the peer names these, which this disk never had: the last of a stream, or of an epoch
  // of which nothing else is known a key without type and seq. `is_all`: the peer has no others, and what it named
  // before is forgotten; else that stands. Of more than kOwnBeyondMax the rest is not remembered.
  void NoteOwnBeyond(AgentId peer, const std::vector<RecordKey>& beyond, bool is_all);

  // What was refused, by who sent it, and what this disk, which has `have`, still lacks of what peers name.
  void Describe(const HaveSet& have, proto::AgentStatus& status) const;

 private:
  void CountRefused(AgentId sender, Cause cause, AgentId origin);

  const Options options_;
  RoleChain chain_;
  std::set<std::string> held_as_records_;                                 // Signatures.
  std::map<std::tuple<AgentId, Cause, AgentId>, std::uint64_t> refused_;  // By sender, cause and origin.
  std::map<AgentId, std::map<StreamKey, std::uint64_t>> own_beyond_;      // Last seqs by peer and stream; 0: an epoch.
  std::map<std::string, proto::LeftOutReport> left_out_;                  // By reader.
};

}  // namespace moondb
