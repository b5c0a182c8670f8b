// ByzantineChecker: invariants of honest agents while a Byzantine agent lies (byzantine_agent.h). The Byzantine agent
// registers each lie here, so the checker need not guess which records are true.
//
// - only_own_lies: No honest agent stores or holds a record that the Byzantine agent forged in an honest agent's name.
//   No honest agent covers a record that never existed.
// - honest_roles: No honest agent acts on roles that the Byzantine agent decided or ordered.
// - honest_converge: When the team is quiescent, the leader covers all records of honest origins that any honest agent
//   holds. If the leader holds such a record, its content is the same.
//
// The class Invariants checks the records that honest origins made and acknowledged.
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

// Reason text of role assignments that the Byzantine agent orders. Honest agents forward this text with the roles.
inline constexpr char kByzantineReason[] = "by the word of a Byzantine agent";

class ByzantineChecker {
 public:
  // `liar` is the Byzantine agent. If `liar` is 0, the team has no Byzantine agent, and no check ever fails.
  ByzantineChecker(AgentId liar, Invariants::Report report) : liar_(liar), report_(std::move(report)) {}

  // Registers a record forged in an honest agent's name. Requires: its content is unique.
  void OnForged(const proto::Record& record);
  // Registers a key that no honest agent ever assigns. The Byzantine agent claims to hold or to have dropped it.
  void OnImpossible(const RecordKey& key);

  // Called when the StorageActor of `agent` receives a StoreRequest with a peer's records, and when it answers.
  // OnStoreReply returns true if the Byzantine agent caused all rejections.
  void OnStoreRequest(AgentId agent, const proto::Message& message);
  bool OnStoreReply(AgentId agent, const proto::Message& message);
  // Checks a record that `agent` holds, or that an honest agent sent to `agent`.
  void OnRecord(AgentId agent, const RecordKey& key, const std::string& content) const;
  void OnRoles(AgentId agent, const proto::RoleAssignment& roles);
  // Called when `agent` stores `roles`. Its disk then proves who has held a role, even if the process ends before it
  // acts on the roles.
  void OnRolesStored(AgentId agent, const proto::RoleAssignment& roles);

  void CheckHave(AgentId agent, const HaveSet& have) const;
  void CheckQuiescent(const QuiescentTeam& team) const;

  // Returns true once an honest agent has given the Byzantine agent a role. Then other agents accept its statements,
  // and it must not lie any more.
  bool is_trusted() const { return is_trusted_; }

 private:
  // The most records of one request that storage may store, and the most that it may refuse.
  struct Expected {
    std::uint32_t may_store = UINT32_MAX;
    std::uint32_t may_refuse = UINT32_MAX;
  };

  bool IsMadeUp(const proto::StoredRecord& record) const;
  static bool IsSlander(const proto::StoredRecord& stored);
  bool IsLie(AgentId agent, AgentId origin) const { return liar_ != 0 && agent != liar_ && origin != liar_; }

  const AgentId liar_;
  const Invariants::Report report_;
  std::set<std::uint64_t> forged_;  // Hashes of forged contents.
  std::set<RecordKey> impossible_;
  std::map<std::pair<AgentId, std::uint64_t>, Expected> expected_;  // Results to expect, by agent and request id.
  bool is_trusted_ = false;
};

}  // namespace moondb::simulation
