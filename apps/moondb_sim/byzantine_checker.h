// ByzantineChecker: what must hold of honest agents while another one lies (byzantine_agent.h). Knows each lie, so that
// it need not guess which records are true.
//
//   only_own_lies     no honest agent stores or holds a record in an honest agent's name that the Byzantine agent made
//                     up, or had one that never was
//   honest_roles      no honest agent acts on roles that the Byzantine agent decided or ordered
//   honest_converge   at rest the leader had whatever any honest agent holds of honest origins, with the same content
//
// What honest origins made and acknowledged is Rules' to watch.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "apps/moondb_sim/invariants.h"
#include "model/have_set.h"
#include "model/record_key.h"
#include "proto/message.pb.h"

namespace moondb::simulation {

// The reason that the Byzantine agent gives for roles that it orders; honest agents pass it on with the roles.
inline constexpr char kByzantineReason[] = "by the word of a Byzantine agent";

class ByzantineChecker {
 public:
  // `liar` 0: the team has none, and nothing is ever wrong.
  ByzantineChecker(AgentId liar, Invariants::Report report) : liar_(liar), report_(std::move(report)) {}

  // It makes this record up for an honest agent. Its content must be like no other's.
  void OnForged(const proto::Record& record);
  // It claims, or drops, what no honest agent ever gives.
  void OnImpossible(const RecordKey& key);

  // Storage of `agent` is to store what a peer sent; and answers. True: what it refuses is the Byzantine agent's doing.
  void OnStoreRequest(AgentId agent, const proto::Message& message);
  bool OnStoreReply(AgentId agent, const proto::Message& message);
  // `agent` holds it, or an honest agent sent it there.
  void OnRecord(AgentId agent, const RecordKey& key, const std::string& content) const;
  void OnRoles(AgentId agent, const proto::RoleAssignment& roles);
  // It stores these, and may end before it acts on them: from then on its disk says who has had a role.
  void OnRolesStored(AgentId agent, const proto::RoleAssignment& roles);

  void CheckHave(AgentId agent, const HaveSet& have) const;
  void CheckQuiescent(const QuiescentTeam& team) const;

  // An honest agent gave it a role: its word counts from now on, and it must not lie any more.
  bool is_trusted() const { return is_trusted_; }

 private:
  // What storage may do with the records of one request.
  struct Expected {
    std::uint32_t may_store = UINT32_MAX;
    std::uint32_t may_refuse = UINT32_MAX;
  };

  bool IsMadeUp(const proto::StoredRecord& record) const;
  static bool IsSlander(const proto::StoredRecord& stored);
  bool IsLie(AgentId agent, AgentId origin) const { return liar_ != 0 && agent != liar_ && origin != liar_; }

  const AgentId liar_;
  const Invariants::Report report_;
  std::set<std::uint64_t> forged_;  // Hashes of contents.
  std::set<RecordKey> impossible_;
  std::map<std::pair<AgentId, std::uint64_t>, Expected> expected_;  // By agent and request.
  bool is_trusted_ = false;
};

}  // namespace moondb::simulation
