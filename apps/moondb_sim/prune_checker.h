// PruneChecker: checks that one simulated agent pruned only records that leader and designated survivor had reported as
// covered when the agent asked them. It sees only requests and answers on the radio, and the agent's have-sets.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/term.pb.h"

namespace moondb::simulation {

// Returns the dropped records in `have` whose types are never superseded. Only a prune can have removed such records.
HaveSet PrunedOf(const HaveSet& have);

class PruneChecker {
 public:
  explicit PruneChecker(AgentId self) : self_(self) {}

  // Called before the agent requests the have-sets of this leader and survivor.
  void OnRoles(const proto::RoleAssignment& roles) {
    roles_ = roles;
    reported_.clear();
  }
  void OnAnswer(AgentId from, const HaveSet& have) { reported_[from] = have; }
  // Called when the agent's StorageActor receives a request to prune.
  void OnPruneRequest();

  // Checks the agent's complete have-set. Returns a text if the agent pruned a record that it was not allowed to prune.
  std::optional<std::string> OnHave(const HaveSet& have) const;

 private:
  const AgentId self_;
  proto::RoleAssignment roles_;
  std::map<AgentId, HaveSet> reported_;
  HaveSet allowed_;  // `held`: records that leader and survivor both covered at a prune of this agent.
};

}  // namespace moondb::simulation
