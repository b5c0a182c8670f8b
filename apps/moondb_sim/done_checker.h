// DoneChecker: gives sharing orders as the operator. When the leader answers that an order is complete, checks that the
// order really is complete (invariant done_is_true).
//
// The checker records all have-sets when it gives an order, and compares them with the have-sets at the instant of the
// answer. A leader gathers other agents' records only once per term, so the checker compares gathered records with the
// have-sets that it last recorded before the term.
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

  // Sends a sharing order of the operator to `leader`. Requires: `leader` leads.
  void Order(AgentId leader, proto::SharingKind kind);
  // Receives the answers to orders, and returns whether there are any. If true, the caller must call CheckAnswers at
  // the same instant. Must not be called while an actor handles a message.
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
  // Returns whether a sync brings all agents' records of this stream to `destination`.
  bool IsBroughtOn(const RecordKey& key, AgentId destination) const;
  // Returns a description of the first record that `sender` held in `before` and `destination` lacks in `now`; null if
  // there is none. Considers only records for which `is_meant` returns true. Ignores pruned and superseded records.
  template <typename IsMeant>
  std::optional<std::string> WhyLacking(const Stores& before, const Stores& now, AgentId sender, AgentId destination,
                                        IsMeant is_meant) const;
  Stores ReadStores();

  SimulatedWorld& world_;
  std::uint64_t last_request_id_ = 0;
  std::map<std::uint64_t, Waiting> waiting_;  // Open orders by request id.
  std::vector<std::pair<Waiting, proto::ShareReply>> answers_;
  Stores last_;                               // Have-sets when the newest order was given.
  std::map<AgentId, Stores> before_term_of_;  // Have-sets last recorded before each agent's present term.
  std::map<AgentId, MonotonicTime> roles_changed_at_;
};

}  // namespace moondb::simulation
