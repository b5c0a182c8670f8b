// PruneChecker: whether one simulated agent pruned only what leader and designated survivor had told it, when it asked
// them, that they had. Fed with what is seen from outside: questions and answers on the radio, and its have-sets.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "model/have_set.h"
#include "proto/term.pb.h"

namespace moondb::simulation {

// What was dropped of types of which nothing is superseded: it was pruned.
HaveSet PrunedOf(const HaveSet& have);

class PruneChecker {
 public:
  explicit PruneChecker(AgentId self) : self_(self) {}

  // It is to ask what these leader and survivor have.
  void OnRoles(const proto::RoleAssignment& roles) {
    roles_ = roles;
    reported_.clear();
  }
  void OnAnswer(AgentId from, const HaveSet& have) { reported_[from] = have; }
  // Storage is told to prune.
  void OnPruneRequest();

  // What is wrong with what it has now, whole.
  std::optional<std::string> OnHave(const HaveSet& have) const;

 private:
  const AgentId self_;
  proto::RoleAssignment roles_;
  std::map<AgentId, HaveSet> reported_;
  HaveSet allowed_;  // Held: what leader and survivor had at one of its prunes.
};

}  // namespace moondb::simulation
