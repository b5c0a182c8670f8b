// PruneChecker: checks that one simulated agent prunes only records that leader and designated survivor reported as
// covered when the agent asked them. It uses only messages and the agent's have-sets.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/term.pb.h"

namespace moondb::simulation {

// Returns the dropped records in `have` of types whose records are never superseded. Only a prune removes such records.
HaveSet PrunedOf(const HaveSet& have);

class PruneChecker {
 public:
  explicit PruneChecker(AgentId self) : self_(self) {}

  // Call when the agent receives `roles`, before it requests the have-sets of leader and survivor.
  void OnRoles(const proto::RoleAssignment& roles) {
    roles_ = roles;
    reported_.clear();
  }
  void OnAnswer(AgentId from, const HaveSet& have) { reported_[from] = have; }
  // Called when the agent's StorageActor receives a request to prune.
  void OnPruneRequest();

  // Checks `have`, the agent's complete have-set. Returns a description if the agent pruned a record that leader and
  // survivor had not reported as covered; null otherwise.
  std::optional<std::string> OnHave(const HaveSet& have) const;

 private:
  const AgentId self_;
  proto::RoleAssignment roles_;
  std::map<AgentId, HaveSet> reported_;
  // Records that leader and survivor had reported as covered before this agent pruned (in StreamHave::held).
  HaveSet allowed_;
};

}  // namespace moondb::simulation
