// PruneChecker: checks that one simulated agent pruned only records that leader and designated survivor had reported as
// covered when it asked them. It sees only requests and answers on the radio, and the agent's have-sets.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/term.pb.h"

namespace moondb::simulation {

// Returns the dropped records of types that are never superseded. Only a prune can have removed them.
HaveSet PrunedOf(const HaveSet& have);

class PruneChecker {
 public:
  explicit PruneChecker(AgentId self) : self_(self) {}

  // The agent is about to request the have-sets of this leader and survivor.
  void OnRoles(const proto::RoleAssignment& roles) {
    roles_ = roles;
    reported_.clear();
  }
  void OnAnswer(AgentId from, const HaveSet& have) { reported_[from] = have; }
  // The agent's StorageActor receives a request to prune.
  void OnPruneRequest();

  // Checks the agent's complete have-set. Returns a text if other records were pruned.
  std::optional<std::string> OnHave(const HaveSet& have) const;

 private:
  const AgentId self_;
  proto::RoleAssignment roles_;
  std::map<AgentId, HaveSet> reported_;
  HaveSet allowed_;  // `held` has the records that leader and survivor covered at one of its prunes.
};

}  // namespace moondb::simulation
