// DoneChecker: checks that a sharing order is complete when an agent answers that it is: the invariant done_is_true.
//
// The operator gives orders that wait for completion. The checker records each agent's have-set when an order is given,
// and compares it with the stores at the instant of the answer. A leader gathers other agents' records only once in a
// term. For these records the checker uses the have-sets that it last recorded before the leader's term.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/moondb_sim/simulated_world.h"
#include "proto/sharing.pb.h"

namespace moondb::simulation {

class DoneChecker {
 public:
  explicit DoneChecker(SimulatedWorld& world) : world_(world) {}

  // Sends an order of the operator to `leader`, which must lead.
  void Order(AgentId leader, proto::SharingKind kind);
  // Returns whether an order was answered. Must not be called within a handler. If it returns true, call CheckAnswers
  // before anything else happens.
  bool HasAnswers();
  void CheckAnswers();

  // Called when `agent` begins to act on new roles.
  void OnRoles(AgentId agent);
  // Called when the agent's disk was wiped or replaced.
  void OnDiskLost(AgentId agent);

 private:
  using Stores = std::map<AgentId, HaveSet>;  // Have-sets of the running agents, by agent.

  struct Waiting {
    AgentId leader = 0;
    proto::SharingKind kind = proto::SHARING_KIND_UNSPECIFIED;
    Stores before;  // Have-sets when the order was given.
  };

  void Check(const Waiting& waiting, const proto::ShareProgress& progress);
  std::optional<std::string> WhyNotDone(const Waiting& waiting, const proto::ShareProgress& progress);
  // Returns a text about the first record that the sender held earlier (`before`) and the destination lacks, such as
  // "agent 3 to agent 1: 3.0001...12 is not there". Considers only records for which `is_meant` is true. Returns null
  // if the destination lacks no record.
  template <typename IsMeant>
  std::optional<std::string> WhyLacking(const Stores& before, const Stores& now, AgentId sender, AgentId destination,
                                        IsMeant is_meant) const;
  Stores ReadStores();

  SimulatedWorld& world_;
  std::uint64_t last_request_id_ = 0;
  std::map<std::uint64_t, Waiting> waiting_;  // Open orders by request id.
  std::vector<std::pair<Waiting, proto::ShareReply>> answers_;
  Stores last_;                               // Have-sets when the newest order was given.
  std::map<AgentId, Stores> before_term_of_;  // Have-sets before the present term of each leader.
  std::map<AgentId, MonotonicTime> roles_changed_at_;
};

}  // namespace moondb::simulation
