// PeerDoor: whose word this agent's store takes, and for what.
//
// Records of an agent are taken from that agent itself, from the base station, and from who leads or survives, or did,
// in an assignment that counts and is held here (model/role_chain.h); assignments, which their issuers sign, from
// anybody. From others records of a third agent are refused, and the bringer is counted by name: a member that lies
// lies about itself alone. So are drops. What peers claim of this agent's own epochs is believed from the same ones.
// In a team without signing keys all are believed.
//
// Streams: a have-set has kHaveStreamsMax of them at most. Of half of these each agent of the team has an equal part;
// who needs more takes of the other half what nobody else has. What goes beyond is refused.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <tuple>

#include "actors/storage/have_ledger.h"
#include "actors/storage/sqlite_database.h"
#include "model/error.h"
#include "model/record_key.h"
#include "model/role_chain.h"

namespace moondb::proto {
class AgentStatus;
}  // namespace moondb::proto

namespace moondb {

class PeerDoor {
 public:
  struct Options {
    AgentId self = 0;
    AgentId base = 0;  // 0: the team has none.
    std::set<AgentId> team;
    RoleChain::Options roles = RoleChain::WithoutKeys();
    std::function<bool(const proto::RoleAssignment&)> is_signed;  // By its issuer's key; in a team with keys alone.
  };
  enum class Cause { kOrigin, kStreams };

  explicit PeerDoor(Options options);

  // The assignments that the store holds: those that were acted on, and those that came as records.
  Result<void> Load(Database& database);
  // Of one that is committed; `is_record`: as a record.
  void NoteAssignment(const proto::RoleAssignment& roles, bool is_record);
  void NoteIfSigned(const proto::RoleAssignment& roles);
  // What ends with this one, newest first, and is not held as a record.
  std::vector<proto::RoleAssignment> NotHeldAsRecords(const proto::RoleAssignment& roles) const;

  // Whether the agent's word is taken for other agents' records; 0 is this agent's own.
  bool IsBelieved(AgentId sender) const;
  // kRefused, and counted: the sender may not bring what is of this stream.
  Result<void> CheckOrigin(AgentId sender, const StreamKey& stream);
  // kRefused, and counted: of its origin `ledger` has no room for this stream, which is new there.
  Result<void> CheckRoom(AgentId sender, const StreamKey& stream, const HaveLedger& ledger);
  // kRefused, and counted: not signed by its issuer.
  Result<void> CheckAssignment(AgentId sender, const proto::RoleAssignment& roles);
  // How many of this agent's own streams and epochs the peer's newest word of them has beyond what this disk ever had;
  // 0 where records have come home meanwhile.
  void NoteOwnBeyond(AgentId peer, std::size_t count);

  // What was refused, by who sent it.
  void Describe(proto::AgentStatus& status) const;

 private:
  void CountRefused(AgentId sender, Cause cause, AgentId origin);
  bool HasRoom(const StreamKey& stream, const HaveLedger& ledger) const;

  const Options options_;
  RoleChain chain_;
  std::set<std::string> held_as_records_;                                 // Signatures.
  std::map<std::tuple<AgentId, Cause, AgentId>, std::uint64_t> refused_;  // By sender, cause and origin.
  std::map<AgentId, std::size_t> own_beyond_;                             // By peer.
};

}  // namespace moondb
