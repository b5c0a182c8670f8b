// ByzantineChecker: invariants of honest agents while a Byzantine agent lies (byzantine_agent.h). The Byzantine agent
// registers each lie here, so the checker need not guess which records are true.
//
// - only_own_lies: No honest agent stores or holds a record that the Byzantine agent forged in an honest agent's name.
//   No honest agent covers a record that never existed.
// - honest_roles: No honest agent acts on roles that the Byzantine agent issued or ordered.
// - honest_converge: When the team is quiescent, the leader covers all records of honest origins that any honest agent
//   holds and may pass on. If the leader holds such a record, its content is the same.
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

// Reason text of the role changes that the Byzantine agent orders. An agent that executes such an order copies the text
// into its role assignment.
inline constexpr char kByzantineReason[] = "by the word of a Byzantine agent";

class ByzantineChecker {
 public:
  // `liar` is the Byzantine agent. If `liar` is 0, the team has no Byzantine agent, and no check ever fails.
  ByzantineChecker(AgentId liar, Invariants::Report report) : liar_(liar), report_(std::move(report)) {}

  // Call when the Byzantine agent forges `record` in an honest agent's name. Requires: the content is unique.
  void OnForged(const proto::Record& record);
  // Registers the key of a record that never existed. The Byzantine agent claims to hold or to have dropped this
  // record.
  void OnImpossible(const RecordKey& key);

  // Call OnStoreRequest when `agent` handles a StoreRequest with a peer's records, and OnStoreReply when `agent`
  // handles the StoreReply. OnStoreReply returns true if the Byzantine agent may have caused all rejections.
  void OnStoreRequest(AgentId agent, const proto::Message& message);
  bool OnStoreReply(AgentId agent, const proto::Message& message);
  // Checks invariant only_own_lies for a record that `agent` holds, or that an honest agent sent to `agent`.
  void OnRecord(AgentId agent, const RecordKey& key, const std::string& content) const;
  void OnRoles(AgentId agent, const proto::RoleAssignment& roles);
  // Call when `agent` stores `roles`, even if it does not act on them yet.
  void OnRolesStored(AgentId agent, const proto::RoleAssignment& roles);

  void CheckHave(AgentId agent, const HaveSet& have) const;
  void CheckQuiescent(const QuiescentTeam& team) const;

  // Returns true once an honest agent has stored or acted on roles that name the Byzantine agent. Other agents then
  // accept its statements, so it must not lie any more.
  bool is_trusted() const { return is_trusted_; }

 private:
  // Limits for the answer to one StoreRequest: the most records that may be stored, and the most that may be refused.
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
  std::map<std::pair<AgentId, std::uint64_t>, Expected> expected_;  // Unanswered requests, by agent and request id.
  bool is_trusted_ = false;
};

}  // namespace moondb::simulation
